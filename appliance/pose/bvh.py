"""BVH files in and out: any channel order, position channels on any joint, bones that stretch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bvh_text import BvhError, BvhJoint, BvhText, read_bvh_text
from appliance.pose.counted import counted
from appliance.pose.plain_names import plain_names
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording, leading_tpose_frames
from appliance.pose.skeleton import Skeleton

__all__ = ["BvhError", "leading_tpose_frames", "read_bvh", "write_bvh"]

STRETCH_M = 1e-6  # a bone that changes less than this keeps one offset


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
    frames that swing away from it. Raises BvhError with the line, or OSError.
    """
    recording = recording_of(read_bvh_text(Path(path), true_fps), metres_per_unit)
    if drop_tpose:
        recording = recording.without_first(leading_tpose_frames(recording))
    return recording


def write_bvh(path: Path | str, recording: Recording, metres_per_unit: float = 0.01, digits: int = 6) -> None:
    """Write a recording: root XYZ position and ZXY rotations; bones that stretch get position channels.

    Names that a file cannot carry are changed (`plain_names`).
    """
    skeleton, names = recording.skeleton, plain_names(recording.skeleton.names)
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
        text.append(f"{indent}{word} {names[joint]}\n{indent}{{")
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
    line = " ".join([f"%.{digits}f"] * table.shape[1])
    text += [line % tuple(row) for row in table.tolist()]
    Path(path).write_text("\n".join(text) + "\n", encoding="utf-8")


def recording_of(text: BvhText, metres_per_unit: float = 0.01) -> Recording:
    """A file as a recording; its notes say what was lost.

    The root's OFFSET is ignored: its channels say where it is. Position channels of other joints replace
    their OFFSET, or are added to it where they are changes of it. Over rows that are missing between others
    the figure turns evenly.
    """
    joints, frames, notes = text.joints, text.frames, text.notes
    poses: Array = np.empty((len(frames), len(joints), 4))
    places = np.empty((len(frames), len(joints), 3))
    moves: NDArray[np.bool_] = np.zeros((len(joints), 3), dtype=bool)  # which coordinates have channels
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
                moves[number, "XYZ".index(channel[0])] = number > 0
    added = _changes(joints, places, moves)
    if added.any():
        places += np.where(added[:, None] & moves, np.array([joint.offset for joint in joints]), 0.0)
        which = f"of {counted(int(added.sum()), 'joint')}" if not added[1:].all() else "of all joints"
        notes = (*notes, f"position channels {which} are added to the OFFSETs: they are changes of these")
    places *= metres_per_unit
    offsets = places[0].copy()
    offsets[0] = 0.0
    stretches = bool(np.ptp(places[:, 1:], axis=0).max(initial=0.0) > STRETCH_M)
    skeleton = Skeleton(
        tuple(j.name for j in joints),
        tuple(j.parent for j in joints),
        offsets,
        tuple(
            (joint, (x * metres_per_unit, y * metres_per_unit, z * metres_per_unit))
            for joint, (x, y, z) in text.ends
        ),
    )
    poses = quaternion.continuous(quaternion.normalize(poses))
    moved = places if stretches else None
    return Recording(skeleton, poses, places[:, 0].copy(), text.fps, moved, notes).spread(text.numbers)


def _changes(joints: list[BvhJoint], places: Array, moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(J,): the joints whose position channels are changes of their OFFSET and do not replace it.

    moves (J, 3): which coordinates have channels. A joint whose channels stay 0 where its OFFSET does not is
    at its OFFSET: it would be inside its parent. Of the others the whole file decides: are they nearer to 0
    than to the OFFSETs?
    """
    offsets = np.where(moves, np.array([joint.offset for joint in joints]), 0.0)
    channels = np.where(moves, places, 0.0)
    still_zero = ~channels.any(axis=(0, 2)) & offsets.any(axis=1)
    mean = channels.mean(axis=0)[~still_zero]
    from_zero = np.linalg.norm(mean, axis=1).sum()
    from_offset = np.linalg.norm(mean - offsets[~still_zero], axis=1).sum()
    changes: NDArray[np.bool_] = still_zero | (np.array(from_zero < from_offset) & moves.any(axis=1))
    return changes
