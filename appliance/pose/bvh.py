"""BVH files in and out: any channel order, position channels on any joint, bones that stretch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bvh_text import BvhError, BvhText, read_bvh_text
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
    frames that swing away from it. The root's OFFSET is ignored: its channels say where it is. Position
    channels of other joints replace their OFFSET. Raises BvhError with the line, or OSError.
    """
    text = read_bvh_text(Path(path))
    recording = _to_recording(text, true_fps or text.fps, metres_per_unit)
    if drop_tpose:
        recording = recording.without_first(leading_tpose_frames(recording))
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
    line = " ".join([f"%.{digits}f"] * table.shape[1])
    text += [line % tuple(row) for row in table.tolist()]
    Path(path).write_text("\n".join(text) + "\n", encoding="utf-8")


def _to_recording(text: BvhText, fps: float, scale: float) -> Recording:
    joints, frames = text.joints, text.frames
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
        tuple((joint, (x * scale, y * scale, z * scale)) for joint, (x, y, z) in text.ends),
    )
    poses = quaternion.continuous(quaternion.normalize(poses))
    return Recording(skeleton, poses, places[:, 0].copy(), fps, places if stretches else None)
