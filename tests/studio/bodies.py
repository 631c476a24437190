"""Dancers as other systems name and measure them: from 22 to 60 joints, metres, Z up, a root of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

Bone = tuple[str, str, tuple[float, float, float]]
_SPINE: list[Bone] = [
    ("Hips", "", (0, 0, 0)),
    ("Spine", "Hips", (0, 0.1, 0)),
    ("Chest", "Spine", (0, 0.15, 0)),
]
_SPINE += [("UpperChest", "Chest", (0, 0.12, 0)), ("Neck", "UpperChest", (0, 0.15, 0))]
_SPINE += [("Head", "Neck", (0, 0.1, 0.01))]
_SIDE = [
    ("Shoulder", "UpperChest", (0.05, 0.1, 0)),
    ("Arm", "Shoulder", (0.12, 0, 0)),
    ("ForeArm", "Arm", (0.28, 0, 0)),
    ("Hand", "ForeArm", (0.25, 0, 0)),
    ("UpLeg", "Hips", (0.09, -0.05, 0)),
    ("Leg", "UpLeg", (0, -0.42, 0)),
    ("Foot", "Leg", (0, -0.42, 0)),
    ("Toe", "Foot", (0, -0.06, 0.14)),
]
NAMINGS = {
    "LAFAN and others": "{side}{joint}",
    "mixamo": "mixamorig:{side}{joint}",
    "kinect": "{joint}{side}",
    "SMPL": "{letter}_{joint}",
    "Unreal": "{joint_lower}_{letter_lower}",
    "Blender": "{joint_lower}.{letter}",
    "DAZ": "{letter_lower}{joint}",
    "Vicon": "{letter}{joint}",
    "VRM": "J_Bip_{letter}_{joint}",
}


def body(naming: str = "{side}{joint}", fingers: int = 0) -> Skeleton:
    """22 joints and two for each finger of each hand; left is +x, Y up, metres."""
    bones = list(_SPINE)
    for side, sign in (("Left", 1), ("Right", -1)):
        joints = [*_SIDE]
        for finger in range(fingers):
            joints.append((f"Finger{finger}", "Hand", (0.08, 0, 0.02 * finger - 0.04)))
            joints.append((f"Finger{finger}Tip", f"Finger{finger}", (0.04, 0, 0)))
        own = {joint for joint, _, _ in joints}

        def called(joint: str, side: str = side, own: set[str] = own) -> str:
            if joint not in own:
                return joint
            words = {"side": side, "joint": joint, "joint_lower": joint.lower(), "letter": side[0]}
            return naming.format(**words, letter_lower=side[0].lower())

        bones += [(called(j), called(above), (sign * x, y, z)) for j, above, (x, y, z) in joints]
    bones = _depth_first(bones)
    names = tuple(name for name, _, _ in bones)
    parents = tuple(names.index(above) if above else -1 for _, above, _ in bones)
    return Skeleton(names, parents, np.array([offset for _, _, offset in bones], dtype=float))


def _depth_first(bones: list[Bone], above: str = "") -> list[Bone]:
    """In the order of a BVH file."""
    return [part for bone in bones if bone[1] == above for part in (bone, *_depth_first(bones, bone[0]))]


def moved(skeleton: Skeleton, seconds: float = 12.0, fps: float = 50.0, seed: int = 0) -> Recording:
    """A dance in which every joint swings about an axis of its own, the body turns, and the root walks."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * fps)) / fps
    poses = np.empty((len(time), len(skeleton), 4))
    for joint in range(len(skeleton)):
        swing = rng.uniform(0.1, 0.5) * np.sin(time * rng.uniform(1, 3) + rng.uniform(0, 6))
        poses[:, joint] = quaternion.from_axis_angle(rng.normal(size=3), swing)
    poses[:, 0] = quaternion.multiply(quaternion.from_axis_angle([0.0, 1.0, 0.0], time), poses[:, 0])
    roots = np.stack([np.sin(time), 0.95 + 0.05 * np.sin(2 * time), np.cos(time)], axis=-1)
    return Recording(skeleton, quaternion.continuous(poses), roots, fps)


def z_up(recording: Recording) -> Recording:
    """As a system writes it in which Z points up and the dancer faces -y at rest."""
    return _with_axes_turned(recording, [1.0, 0.0, 0.0])


def sideways(recording: Recording) -> Recording:
    """As a system writes it in which the dancer faces +x at rest: left and right lie along z."""
    return _with_axes_turned(recording, [0.0, 1.0, 0.0])


def _with_axes_turned(recording: Recording, axis: list[float]) -> Recording:
    """The same motion with the axes of the room and of every joint turned by 90 degrees."""
    turn = quaternion.from_axis_angle(axis, np.pi / 2)

    def turned(vectors: Array) -> Array:
        return quaternion.rotate(np.broadcast_to(turn, (*vectors.shape[:-1], 4)), vectors)

    poses = recording.poses.copy()
    poses[..., 1:] = turned(poses[..., 1:])
    skeleton = replace(recording.skeleton, offsets=turned(recording.skeleton.offsets))
    return replace(recording, skeleton=skeleton, poses=poses, roots=turned(recording.roots))


def carried(recording: Recording) -> Recording:
    """With a root that never moves above the hips, as 'Reference' or 'Armature' in exported files."""
    old = recording.skeleton
    skeleton = Skeleton(
        ("Reference", *old.names),
        (-1, *(parent + 1 for parent in old.parents)),
        np.concatenate([np.zeros((1, 3)), old.offsets]),
    )
    still = np.tile(quaternion.IDENTITY.astype(float), (len(recording), 1, 1))
    places = np.tile(skeleton.offsets, (len(recording), 1, 1))
    places[:, 1] = recording.roots
    poses = np.concatenate([still, recording.poses], axis=1)
    return Recording(skeleton, poses, np.zeros_like(recording.roots), recording.fps, places)
