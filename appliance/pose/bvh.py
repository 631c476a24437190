"""BVH files in and out: any channel order, position channels on any joint, errors with the line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn, TextIO

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

MAX_LINE = 1 << 17  # characters; the longest honest line is one frame of some hundred channels
MAX_JOINTS = 1000
TPOSE_SEARCH_FRAMES = 10
TPOSE_JUMP_DEGREES = 25.0
STRETCH_M = 1e-6  # a bone that changes less than this keeps one offset
_CHANNELS = {f"{axis}{kind}" for axis in "XYZ" for kind in ("position", "rotation")}


class BvhError(ValueError):
    """A BVH file that cannot be read: which file, which line, what is wrong."""

    def __init__(self, path: Path, line: int, message: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {message}")


@dataclass
class _Joint:
    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: list[str] = field(default_factory=list)


def read_bvh(
    path: Path | str,
    *,
    true_fps: float | None = None,
    metres_per_unit: float = 0.01,
    drop_tpose: bool = False,
) -> Recording:
    """Read a recording.

    true_fps overrides the header's frame time (many converted files carry a wrong one);
    metres_per_unit: 0.01 for files in centimetres; drop_tpose leaves out a rest pose at the start with the
    frames that jump from it. The root's OFFSET is ignored: its position channels say where it is. Position
    channels of other joints replace their OFFSET. Raises BvhError with the line, or OSError.
    """
    path = Path(path)
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = _Lines(path, file)
        joints, ends = _read_hierarchy(lines)
        frames, fps = _read_motion(lines, joints)
    recording = _to_recording(joints, ends, frames, true_fps or fps, metres_per_unit)
    if drop_tpose:
        recording = recording.without_first(leading_tpose_frames(recording))
    if not len(recording):
        raise BvhError(path, lines.number, "no frames are left. Record at least one pose after the T-pose.")
    return recording


def write_bvh(path: Path | str, recording: Recording, metres_per_unit: float = 0.01, digits: int = 6) -> None:
    """Write a recording: root XYZ position and ZXY rotations; bones that stretch get position channels."""
    skeleton = recording.skeleton
    moving = set() if recording.translations is None else set(range(1, len(skeleton)))
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(skeleton.parents):
        children.setdefault(parent, []).append(joint)
    order: list[int] = []
    text = ["HIERARCHY"]

    def numbers(values: NDArray[np.float64]) -> str:
        return " ".join(f"{v / metres_per_unit:.{digits}f}" for v in values)

    def write_joint(joint: int, indent: str) -> None:
        order.append(joint)
        word = "ROOT" if skeleton.parents[joint] < 0 else "JOINT"
        position = "Xposition Yposition Zposition " if word == "ROOT" or joint in moving else ""
        text.append(f"{indent}{word} {skeleton.names[joint]}\n{indent}{{")
        text.append(f"{indent}  OFFSET {numbers(skeleton.offsets[joint])}")
        rotation = "Zrotation Xrotation Yrotation"
        text.append(f"{indent}  CHANNELS {6 if position else 3} {position}{rotation}")
        for child in children.get(joint, []):
            write_joint(child, indent + "  ")
        for parent, offset in skeleton.ends:
            if parent == joint:
                site = f"{indent}  End Site\n{indent}  {{\n{indent}    OFFSET {numbers(np.array(offset))}"
                text.append(f"{site}\n{indent}  }}")
        text.append(f"{indent}}}")

    write_joint(0, "")
    text.append(f"MOTION\nFrames: {len(recording)}\nFrame Time: {1 / recording.fps:.12g}")
    angles = np.degrees(quaternion.to_euler_zxy(recording.poses.astype(np.float64)))
    columns: list[Array] = []
    for joint in order:
        if skeleton.parents[joint] < 0:
            columns.append(recording.roots / metres_per_unit)
        elif recording.translations is not None:
            columns.append(recording.translations[:, joint] / metres_per_unit)
        columns.append(angles[:, joint])
    table = np.concatenate(columns, axis=1)
    text += [" ".join(f"{v:.{digits}f}" for v in row) for row in table]
    Path(path).write_text("\n".join(text) + "\n", encoding="utf-8")


def leading_tpose_frames(recording: Recording) -> int:
    """How many frames at the start are a rest pose or jump away from one."""
    head = recording.poses[: TPOSE_SEARCH_FRAMES + 1]
    if len(head) < 2:
        return 0
    steps = np.degrees(quaternion.angle_between(head[1:], head[:-1])).max(axis=-1)
    jumps = np.flatnonzero(steps > TPOSE_JUMP_DEGREES)
    return int(jumps[-1]) + 1 if len(jumps) else 0


class _Lines:
    """Lines of a file with their number, without blank ones, never longer than MAX_LINE."""

    def __init__(self, path: Path, file: TextIO) -> None:
        self.path, self.number, self._file = path, 0, file

    def next(self, expected: str) -> list[str]:
        while True:
            line = self._file.readline(MAX_LINE)
            self.number += 1
            if not line:
                self.fail(f"the file ends here, {expected} should follow. Export the recording again.")
            if len(line) >= MAX_LINE:
                self.fail(f"a line of more than {MAX_LINE} characters: this is not a BVH file.")
            if words := line.split():
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


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_hierarchy(lines: _Lines) -> tuple[list[_Joint], list[tuple[int, tuple[float, float, float]]]]:
    words = lines.next("the word HIERARCHY")
    if words[0].upper() != "HIERARCHY":
        lines.fail("the first word is not HIERARCHY: this is not a BVH file.")
    joints: list[_Joint] = []
    ends: list[tuple[int, tuple[float, float, float]]] = []
    open_joints: list[int] = []  # -1 stands for an End Site
    while True:
        words = lines.next("the rest of the hierarchy")
        key = words[0].upper()
        inside = open_joints[-1] if open_joints else None
        if key in ("ROOT", "JOINT"):
            _open_joint(lines, joints, open_joints, key, " ".join(words[1:]))
        elif key == "END" and inside is not None and inside >= 0:
            _expect_brace(lines)
            open_joints.append(-1)
        elif key == "OFFSET" and inside is not None:
            if len(words) != 4:
                lines.fail(f"OFFSET needs 3 numbers, here are {len(words) - 1}.")
            x, y, z = lines.floats(words[1:], "OFFSET")
            if inside < 0:
                ends.append((open_joints[-2], (x, y, z)))
            else:
                joints[inside].offset = (x, y, z)
        elif key == "CHANNELS" and inside is not None and inside >= 0:
            joints[inside].channels = _channels(lines, words)
        elif key == "}" and open_joints:
            open_joints.pop()
        elif key == "MOTION" and not open_joints and joints:
            return joints, ends
        else:
            lines.fail(f"'{words[0][:40]}' is not expected here in the hierarchy.")


def _open_joint(lines: _Lines, joints: list[_Joint], opened: list[int], key: str, name: str) -> None:
    if (key == "ROOT") != (not joints):
        lines.fail("a BVH file has exactly one ROOT, and it comes first.")
    if opened and opened[-1] < 0:
        lines.fail("a joint cannot stand inside an End Site.")
    if joints and not opened:
        lines.fail("a JOINT stands outside the ROOT: one closing brace too many?")
    if not name:
        lines.fail(f"a {key} without a name.")
    if any(name == joint.name for joint in joints):
        lines.fail(f"the joint name '{name}' is used twice.")
    if len(joints) == MAX_JOINTS:
        lines.fail(f"more than {MAX_JOINTS} joints: this is not a dancer.")
    if name.endswith("{"):
        name = name[:-1].strip()
    else:
        _expect_brace(lines)
    joints.append(_Joint(name, opened[-1] if opened else -1))
    opened.append(len(joints) - 1)


def _expect_brace(lines: _Lines) -> None:
    if lines.next("an opening brace") != ["{"]:
        lines.fail("an opening brace '{' should stand here.")


def _channels(lines: _Lines, words: list[str]) -> list[str]:
    names = [w.capitalize() for w in words[2:]]
    if len(words) < 2 or not words[1].isdigit() or int(words[1]) != len(names):
        lines.fail(f"CHANNELS says {words[1] if len(words) > 1 else 'nothing'}, {len(names)} names follow.")
    for name in names:
        if name not in _CHANNELS:
            lines.fail(f"unknown channel '{name}'. Known: {', '.join(sorted(_CHANNELS))}.")
    if len(set(names)) != len(names):
        lines.fail("a channel is named twice.")
    return names


def _read_motion(lines: _Lines, joints: list[_Joint]) -> tuple[NDArray[np.float64], float]:
    words = lines.next("'Frames:'")
    if words[0].upper() != "FRAMES:" or len(words) != 2 or not words[1].isdigit():
        lines.fail("'Frames: N' should stand here.")
    count = int(words[1])
    words = lines.next("'Frame Time:'")
    if [w.upper() for w in words[:2]] != ["FRAME", "TIME:"] or len(words) != 3:
        lines.fail("'Frame Time: S' should stand here.")
    frame_time = float(lines.floats(words[2:], "Frame Time")[0])
    if not 1e-4 <= frame_time <= 10:
        lines.fail(f"a frame time of {frame_time} s is not plausible (0.0001 to 10).")
    width = sum(len(joint.channels) for joint in joints)
    rows = list(_rows(lines, count, width))
    if not rows:
        lines.fail("the file has no frames.")
    return np.array(rows), 1 / frame_time


def _rows(lines: _Lines, count: int, width: int) -> Iterator[NDArray[np.float64]]:
    for frame in range(count):
        words = lines.next(f"frame {frame + 1} of {count}")
        if len(words) != width:
            lines.fail(f"frame {frame + 1} has {len(words)} values, the channels need {width}.")
        yield lines.floats(words, f"frame {frame + 1}")
    while True:  # what follows must be blank
        line = lines._file.readline(MAX_LINE)
        lines.number += 1
        if not line:
            return
        if line.strip():
            lines.fail(f"more lines follow than the {count} frames that the header announces.")


def _to_recording(
    joints: list[_Joint],
    ends: list[tuple[int, tuple[float, float, float]]],
    frames: NDArray[np.float64],
    fps: float,
    scale: float,
) -> Recording:
    poses: Array = np.empty((len(frames), len(joints), 4))
    places = np.empty((len(frames), len(joints), 3))
    first = 0
    for number, joint in enumerate(joints):
        values = frames[:, first : first + len(joint.channels)]
        first += len(joint.channels)
        turning = [i for i, channel in enumerate(joint.channels) if channel.endswith("rotation")]
        axes = "".join(joint.channels[i][0].lower() for i in turning)
        poses[:, number] = quaternion.from_euler(np.radians(values[:, turning]), axes)
        places[:, number] = np.array(joint.offset) if number else 0.0
        for i, channel in enumerate(joint.channels):
            if channel.endswith("position"):
                places[:, number, "XYZ".index(channel[0])] = values[:, i]
    places *= scale
    offsets = places[0].copy()
    offsets[0] = 0.0
    stretches = bool(np.ptp(places[:, 1:], axis=0).max(initial=0.0) > STRETCH_M)
    skeleton = Skeleton(
        tuple(j.name for j in joints),
        tuple(j.parent for j in joints),
        offsets,
        tuple((joint, (x * scale, y * scale, z * scale)) for joint, (x, y, z) in ends),
    )
    poses = quaternion.continuous(quaternion.normalize(poses))
    return Recording(skeleton, poses, places[:, 0].copy(), fps, places if stretches else None)
