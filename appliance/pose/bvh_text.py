"""The text of a BVH file, hierarchy and rows of numbers: read in bounded memory, errors with the line."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from appliance.pose.foreign_file import opened

MAX_LINE = 1 << 17  # characters; the longest honest line is one frame of some hundred channels
MAX_BLANK_LINES = 1000  # in a row; a file of line ends alone must not block
MAX_JOINTS = 1000
MAX_VALUES = 50_000_000  # 400 MB: 50 minutes of 132 channels at 120 poses a second
_STAGE_FPS = 50  # recordings are resampled to this rate: slow frames become many
_CHANNELS = {f"{axis}{kind}" for axis in "XYZ" for kind in ("position", "rotation")}


class BvhError(ValueError):
    """A BVH file that cannot be read: which file, which line, what is wrong."""

    def __init__(self, path: Path, line: int, message: str) -> None:
        self.path, self.line = path, line
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
    """What a file says: joints with parents first, End Sites as (joint, offset), frames (N, channels)."""

    joints: list[BvhJoint]
    ends: list[tuple[int, tuple[float, float, float]]]
    frames: NDArray[np.float64]
    fps: float


def read_bvh_text(path: Path) -> BvhText:
    """Read all of a file; raises BvhError or OSError."""
    with TextIOWrapper(opened(path), encoding="utf-8-sig", errors="replace") as file:
        lines = _Lines(path, file)
        joints, ends = _read_hierarchy(lines)
        frames, fps = _read_motion(lines, joints)
    return BvhText(joints, ends, frames, fps)


class _Lines:
    """Lines of a file with their number, without blank ones, never longer than MAX_LINE."""

    def __init__(self, path: Path, file: TextIOWrapper) -> None:
        self.path, self.number, self._file = path, 0, file
        self.bytes = os.fstat(file.fileno()).st_size

    def next(self, expected: str) -> list[str]:
        """Words of the next line that has any; fails at the end of the file."""
        words = self.next_or_end()
        if not words:
            self.fail(f"the file ends here, {expected} should follow. Export the recording again.")
        return words

    def next_or_end(self) -> list[str]:
        """Words of the next line that has any; none at the end of the file."""
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

    def fail(self, message: str) -> NoReturn:
        raise BvhError(self.path, self.number, message)

    def floats(self, words: list[str], what: str) -> NDArray[np.float64]:
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError:
            bad = next(w for w in words if not _is_number(w))
            self.fail(f"{what}: '{bad[:40]}' is not a number.")
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
        lines.fail("the first word is not HIERARCHY: this is not a BVH file.")
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
            lines.fail("MOTION stands here, but the hierarchy is not complete: a closing brace is missing.")
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
    """The brace that opens a block: at the end of its line or alone on the next one."""
    if not words[-1].endswith("{") and lines.next("an opening brace") != ["{"]:
        lines.fail("an opening brace '{' should stand here.")


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


def _read_motion(lines: _Lines, joints: list[BvhJoint]) -> tuple[NDArray[np.float64], float]:
    count = _count(_headed(lines, "Frames:", "N"))
    if count < 0:
        lines.fail("'Frames: N' should stand here.")
    if not count:
        lines.fail("the file has no frames.")
    seconds = _headed(lines, "Frame Time:", "S")
    frame_time = float(lines.floats([seconds], "Frame Time")[0])
    if not 1e-4 <= frame_time <= 10:
        lines.fail(f"a frame time of {frame_time} s is not plausible (0.0001 to 10).")
    width = sum(len(joint.channels) for joint in joints)
    if not width:
        lines.fail("no joint has a channel: nothing can move.")
    if count * width * max(1.0, _STAGE_FPS * frame_time) > MAX_VALUES:
        lines.fail(
            f"{count} frames of {width} values ({count * frame_time:.0f} s) are too many to read. "
            "Cut the recording into pieces."
        )
    return _read_frames(lines, count, width), 1 / frame_time


def _headed(lines: _Lines, heading: str, what: str) -> str:
    """The one word after a heading such as 'Frame Time:', in any case and spacing."""
    words = " ".join(lines.next(f"'{heading}'")).replace(":", ": ").split()
    expected = heading.upper().split()
    if [w.upper() for w in words[:-1]] != expected:
        lines.fail(f"'{heading} {what}' should stand here.")
    return words[-1]


def _read_frames(lines: _Lines, count: int, width: int) -> NDArray[np.float64]:
    frames = np.empty((min(count, lines.bytes // (2 * width) + 1), width))  # a value is two bytes or more
    for frame in range(count):
        words = lines.next(f"frame {frame + 1} of {count}")
        if len(words) != width:
            lines.fail(f"frame {frame + 1} has {len(words)} values, the channels need {width}.")
        frames[frame] = lines.floats(words, f"frame {frame + 1}")
    if lines.next_or_end():
        lines.fail(f"more lines follow than the {count} frames that the header announces.")
    return frames
