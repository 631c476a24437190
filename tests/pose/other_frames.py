"""The same motion in another frame: from another zero pose, in other units, along other axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording


def rezeroed(dance: Recording, zero: Array) -> Recording:
    """The same motion from another zero pose: the joints' world rotations in it, (J, 4)."""
    skeleton = dance.skeleton
    above = [
        zero[parent] if parent >= 0 else quaternion.IDENTITY.astype(float) for parent in skeleton.parents
    ]
    back = quaternion.inverse(zero)
    poses = np.empty_like(dance.poses)
    for joint in range(len(skeleton)):
        poses[:, joint] = quaternion.multiply(
            quaternion.multiply(above[joint], dance.poses[:, joint]), back[joint]
        )
    offsets = np.stack([quaternion.rotate(above[j], skeleton.offsets[j]) for j in range(len(skeleton))])
    ends = tuple((j, tuple(quaternion.rotate(zero[j], np.array(end)).tolist())) for j, end in skeleton.ends)
    moved = dance.translations
    if moved is not None:
        moved = np.stack(
            [
                quaternion.rotate(np.broadcast_to(above[j], (len(moved), 4)), moved[:, j])
                for j in range(len(skeleton))
            ],
            axis=1,
        )
    return Recording(
        replace(skeleton, offsets=offsets, ends=ends),
        quaternion.continuous(poses),
        dance.roots,
        dance.fps,
        moved,
    )


def scaled(dance: Recording, factor: float) -> Recording:
    skeleton = dance.skeleton
    ends = tuple((j, (x * factor, y * factor, z * factor)) for j, (x, y, z) in skeleton.ends)
    return replace(
        dance,
        skeleton=replace(skeleton, offsets=skeleton.offsets * factor, ends=ends),
        roots=dance.roots * factor,
        translations=None if dance.translations is None else dance.translations * factor,
    )


def axes_turned(dance: Recording, turn: Array) -> Recording:
    """The same motion with the axes of the room and of every joint turned."""

    def turned(vectors: Array) -> Array:
        return quaternion.rotate(np.broadcast_to(turn, (*vectors.shape[:-1], 4)), vectors)

    skeleton, poses = dance.skeleton, dance.poses.copy()
    poses[..., 1:] = turned(poses[..., 1:])
    ends = tuple((j, tuple(turned(np.array(end)).tolist())) for j, end in skeleton.ends)
    return replace(
        dance,
        skeleton=replace(skeleton, offsets=turned(skeleton.offsets), ends=ends),
        poses=poses,
        roots=turned(dance.roots),
        translations=None if dance.translations is None else turned(dance.translations),
    )
