"""The text of a BVH file, hierarchy and rows of numbers: read in bounded memory, errors with the line.

A row that is no frame costs that row: the whole ones are kept, and a note says which were lost.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from appliance.pose.correctable_error import CorrectableError
from appliance.pose.counted import counted
from appliance.pose.foreign_file import opened_text
from appliance.pose.kept_rows import KeptRows

MAX_LINE = 1 << 17  # characters; the longest honest line is one frame of some hundred channels
MAX_BLANK_LINES = 1000  # in a row; a file of only line ends must not block
MAX_SPOILT_ROWS = 1000  # in a row; behind so many no frame is looked for
MAX_JOINTS = 1000
MAX_VALUES = 50_000_000  # 400 MB: 50 minutes of 132 channels at 120 poses a second
_STAGE_FPS = 50  # recordings are resampled to this rate: slow frames become many
_SHORTEST_S, _LONGEST_S = 1e-4, 10.0  # between two frames
_USUAL_FPS: tuple[float, ...] = (24, 25, 30, 48, 50, 60, 72, 75, 90, 100, 120, 125, 144, 150, 180, 200, 240)
_USUAL_FPS += (250, 300, 360, 480, 500, 960, 1000, 23.976, 29.97, 59.94, 119.88)
_CHANNELS = {f"{axis}{kind}" for axis in "XYZ" for kind in ("position", "rotation")}


class BvhError(CorrectableError, ValueError):
    """A BVH file that cannot be read: which file, which line, what is wrong."""

    def __init__(self, path: Path, line: int, message: str) -> None:
        self.path, self.line, self.message = path, line, message
        super().__init__(f"{path}:{line}: {message}")


@dataclass
class BvhJoint:
    """A joint as the file describes it; offset in the file's units, channels such as 'Zrotation'."""

    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class BvhText:
    """The content of a file: joints with parents first, End Sites as (joint, offset), frames (N, channels).

    numbers (N,): which frame of the recording each row is, rising; spoilt rows are missing. fps: as told, or
    by the header; header_fps: None where that is no rate. notes: what was lost or read another way, in words.
    """

    joints: list[BvhJoint]
    ends: list[tuple[int, tuple[float, float, float]]]
    frames: NDArray[np.float64]
    numbers: NDArray[np.intp]
    fps: float
    header_fps: float | None
    notes: tuple[str, ...]


def read_bvh_text(path: Path, true_fps: float | None = None) -> BvhText:
    """Read all of a file; true_fps: in place of the header's. Raises BvhError or OSError."""
    with opened_text(path) as file:
        lines = _Lines(path, file)
        joints, ends = _read_hierarchy(lines)
        width = sum(len(joint.channels) for joint in joints)
        announced = _headed(lines, "Frames:")
        announced_in = lines.number
        header_fps, notes = _read_rate(lines, true_fps)
        if not width:
            lines.fail("no joint has a channel: nothing can move.")
        fps = true_fps or header_fps
        assert fps is not None  # or the header was refused
        frames, rows = _read_rows(lines, width, fps)
    if _count(announced) != rows.count:
        said = f"'{announced[:40]}'" if announced else "nothing"
        there = f"{counted(rows.count, 'row')} {'is' if rows.count == 1 else 'are'} there"
        notes.append(f"line {announced_in}: the header announces {said} as the number of frames, {there}")
    if lines.decimal_commas:
        notes.append("decimal commas read as points")
    return BvhText(joints, ends, frames, np.array(rows.numbers), fps, header_fps, (*notes, *rows.notes()))


class _Lines:
    """Lines of a file with their number, without blank ones, never longer than MAX_LINE."""

    def __init__(self, path: Path, file: TextIOWrapper) -> None:
        self.path, self.number, self._file = path, 0, file
        self.decimal_commas = False
        self._again: list[str] = []
        self.bytes = os.fstat(file.fileno()).st_size

    def next(self, expected: str) -> list[str]:
        """Words of the next line that has any; fails at the end of the file."""
        words = self.next_or_end()
        if not words:
            self.fail(f"the file ends here, {expected} should follow. Export the recording again.")
        return words

    def next_or_end(self) -> list[str]:
        """Words of the next line that has any; none at the end of the file."""
        if self._again:
            words, self._again = self._again, []
            return words
        for _ in range(MAX_BLANK_LINES):
            line = self._file.readline(MAX_LINE)
            self.number += 1
            if len(line) >= MAX_LINE:
                self.fail(f"a line of more than {MAX_LINE} characters: this is not a BVH file.")
            if (words := line.split()) or not line:
                break
        else:
            self.fail(f"more than {MAX_BLANK_LINES} blank lines in a row: this is not a BVH file.")
        return words

    def again(self, words: list[str]) -> None:
        """The next line is this one once more."""
        self._again = words

    def fail(self, message: str) -> NoReturn:
        raise BvhError(self.path, self.number, message)

    def floats(self, words: list[str], what: str) -> NDArray[np.float64]:
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError:
            points = [word.replace(",", ".", 1) for word in words]  # as programs in many countries write
            bad = next((w for w, point in zip(words, points, strict=True) if not _is_number(point)), None)
            if bad is not None:
                self.fail(f"{what}: '{bad[:40]}' is not a number.")
            values, self.decimal_commas = np.array(points, dtype=np.float64), True
        if not np.isfinite(values).all():
            self.fail(f"{what}: a value is not finite (NaN or infinite). Export the recording again.")
        return values


def _count(word: str) -> int:
    """A number of things written in plain digits, -1 for anything else."""
    return int(word) if word.isascii() and word.isdigit() and len(word) < 16 else -1


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_hierarchy(lines: _Lines) -> tuple[list[BvhJoint], list[tuple[int, tuple[float, float, float]]]]:
    words = lines.next("the word HIERARCHY")
    if words[0].upper() != "HIERARCHY":
        lines.fail("the first word is not HIERARCHY: this is not a BVH file. See `bunraku convert`.")
    joints: list[BvhJoint] = []
    ends: list[tuple[int, tuple[float, float, float]]] = []
    open_joints: list[int] = []  # -1 stands for an End Site
    described: set[str] = set()  # which of OFFSET and CHANNELS the open block has had
    while True:
        words = lines.next("the rest of the hierarchy")
        key = words[0].upper()
        inside = open_joints[-1] if open_joints else None
        if key in described:
            lines.fail(f"a second {key} for one joint: a brace is missing above.")
        if key in ("ROOT", "JOINT"):
            _open_joint(lines, joints, open_joints, key, words[1:])
            described = set()
        elif key == "END" and inside is not None and inside >= 0:
            _open_block(lines, words)
            open_joints.append(-1)
            described = {"CHANNELS"}
        elif key == "OFFSET" and inside is not None:
            offset = _offset(lines, words)
            if inside < 0:
                ends.append((open_joints[-2], offset))
            else:
                joints[inside].offset = offset
            described.add(key)
        elif key == "CHANNELS" and inside is not None:
            joints[inside].channels = _channels(lines, words)
            described.add(key)
        elif words == ["}"] and open_joints:
            open_joints.pop()
            described = {"OFFSET", "CHANNELS"}
        elif key == "MOTION" and not open_joints and joints:
            return joints, ends
        elif key == "MOTION":
            lines.fail("MOTION is here, but the hierarchy is not complete: a closing brace is missing.")
        else:
            lines.fail(f"'{words[0][:40]}' is not expected here in the hierarchy.")
        if len(ends) > MAX_JOINTS:
            lines.fail(f"more than {MAX_JOINTS} End Sites: this is not a dancer.")


def _open_joint(lines: _Lines, joints: list[BvhJoint], opened: list[int], key: str, words: list[str]) -> None:
    if (key == "ROOT") != (not joints):
        lines.fail("a BVH file has exactly one ROOT, and it comes first.")
    if opened and opened[-1] < 0:
        lines.fail("a joint cannot stand inside an End Site.")
    if joints and not opened:
        lines.fail("a JOINT stands outside the ROOT: one closing brace too many?")
    name = " ".join(words).removesuffix("{").strip()
    if not name:
        lines.fail(f"a {key} without a name.")
    if any(name == joint.name for joint in joints):
        lines.fail(f"the joint name '{name[:40]}' is used twice.")
    if len(joints) == MAX_JOINTS:
        lines.fail(f"more than {MAX_JOINTS} joints: this is not a dancer.")
    _open_block(lines, words)
    joints.append(BvhJoint(name, opened[-1] if opened else -1))
    opened.append(len(joints) - 1)


def _open_block(lines: _Lines, words: list[str]) -> None:
    """The brace that opens a block: at the end of its line or by itself on the next one."""
    if not words[-1].endswith("{") and lines.next("an opening brace") != ["{"]:
        lines.fail("an opening brace '{' is missing here.")


def _offset(lines: _Lines, words: list[str]) -> tuple[float, float, float]:
    if len(words) != 4:
        lines.fail(f"OFFSET needs 3 numbers, here are {len(words) - 1}.")
    x, y, z = lines.floats(words[1:], "OFFSET")
    return float(x), float(y), float(z)


def _channels(lines: _Lines, words: list[str]) -> list[str]:
    names = [w.capitalize() for w in words[2:]]
    if len(words) < 2 or _count(words[1]) != len(names):
        said = words[1][:40] if len(words) > 1 else "nothing"
        lines.fail(f"CHANNELS says {said}, {len(names)} names follow.")
    for name in names:
        if name not in _CHANNELS:
            lines.fail(f"unknown channel '{name[:40]}'. Known: {', '.join(sorted(_CHANNELS))}.")
    if len(set(names)) != len(names):
        lines.fail("a channel is named twice.")
    return names


def _headed(lines: _Lines, heading: str) -> str:
    """The text after a heading such as 'Frame Time:', in any case and spacing; '' where there is none."""
    words = " ".join(lines.next(f"'{heading}'")).replace(":", ": ").split()
    expected = heading.upper().split()
    if [word.upper() for word in words[: len(expected)]] != expected:
        lines.fail(f"'{heading}' is missing here.")
    return " ".join(words[len(expected) :])


def _read_rate(lines: _Lines, true_fps: float | None) -> tuple[float | None, list[str]]:
    """Frames a second by the header, and how that was read; None for no rate where the true one is told."""
    words = lines.next("'Frame Time:'")
    lines.again(words)
    if true_fps is not None and _is_number(words[0]):
        return None, [f"line {lines.number}: no line says the frame time"]
    said = _headed(lines, "Frame Time:")
    time = float(said.replace(",", ".", 1)) if _is_number(said.replace(",", ".", 1)) else np.nan
    guessed = _rate_that_is_no_time(time)
    if guessed is not None:
        guess = f"line {lines.number}: a frame time of {said} read as {guessed:.5g} poses a second"
        return guessed, [] if true_fps else [f"{guess} (otherwise: --true-fps)"]
    if _SHORTEST_S <= time <= _LONGEST_S:
        return 1.0 / time, []
    if true_fps is None:
        lines.fail(
            f"a frame time of '{said[:40]}' s is not plausible ({_SHORTEST_S:g} to {_LONGEST_S:g}). Give the "
            "rate: --true-fps 60."
        )
    return None, []


def _rate_that_is_no_time(time: float) -> float | None:
    """Frames a second where a 'frame time' is them, or is in milliseconds; None for seconds and for anything
    that may be either."""
    if not time > 1.0:
        return None
    as_rate, as_ms = (min(_USUAL_FPS, key=lambda usual: abs(usual - fps)) for fps in (time, 1000.0 / time))
    is_rate, is_ms = abs(as_rate - time) < 1e-3 * time, abs(as_ms * time / 1000.0 - 1.0) < 1e-3
    return None if is_rate == is_ms else float(time if is_rate else as_ms)


def _read_rows(lines: _Lines, width: int, fps: float) -> tuple[NDArray[np.float64], KeptRows]:
    """All whole rows up to the end. Raises BvhError where there is none, or too many at the stage's rate."""
    most = int(MAX_VALUES / (width * max(1.0, _STAGE_FPS / fps)))
    frames = np.empty((min(lines.bytes // (2 * width) + 1, most), width))  # a value is two bytes or more
    rows = KeptRows()
    first: BvhError | None = None
    while True:
        try:
            words = lines.next_or_end()
            if rows.lost_in_a_row > MAX_SPOILT_ROWS:
                lines.fail(f"more than {MAX_SPOILT_ROWS} rows behind each other are no frames.")
            if words and words[0].upper() == "HIERARCHY":
                lines.fail("a second recording begins here. Save it in a file for itself.")
        except BvhError as error:
            first = first or error
            rows.stopped = f"line {error.line}: {error.message.rstrip('.')}"
            break
        if not words:
            break
        if len(rows.numbers) == most:
            lines.fail(
                f"more than {most} frames of {width} values ({most / fps:.0f} s) are too many to read. "
                "Cut the recording into pieces, or give its true rate: --true-fps 60."
            )
        try:
            if len(words) != width:
                lines.fail(f"frame {rows.count + 1} has {len(words)} values, the channels need {width}.")
            frames[len(rows.numbers)] = lines.floats(words, f"frame {rows.count + 1}")
            rows.keep(lines.number)
        except BvhError as error:
            first = first or error
            rows.lose(lines.number, error.message)
    if not rows.numbers:
        raise first or BvhError(lines.path, lines.number, "the file has no frames. Export it again.")
    return frames[: len(rows.numbers)], rows
