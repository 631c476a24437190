"""The mirror image of a dance: which joints are counterparts, and whether the body is symmetric."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bones import span_m
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

UNEQUAL = 0.03  # of the body's span: tolerance between the two sides (a dancer's head sits 5 mm off)
OPPOSITE_DEGREES = 120.0  # a joint usually this far from its counterpart's image has other axes
SIDEWAYS = (0, 2)  # left and right lie along x or along z; a mirror on the floor would be none

_WORDS = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R"}
_OTHER = {**_WORDS, **{right: left for left, right in _WORDS.items()}}
# Where a name has its side, the likeliest first: mixamorig:LeftArm, hand_left; L_Arm, arm.l.001; lShldr,
# LThumb, Bip_LHand; ArmL, ArmLT; lfoot.
_PLACES = (
    r"left|right|Left|Right|LEFT|RIGHT",
    r"(?<![A-Za-z0-9])[lLrR](?![A-Za-z0-9])",
    r"(?<![A-Za-z0-9])[lLrR](?=[A-Z])",
    r"(?<=[a-z0-9])[LR](?=T?$)",
    r"^[lr]",
)


def mirror_pairs(skeleton: Skeleton) -> NDArray[np.intp]:
    """(J,): for each joint its counterpart on the other side (itself for the spine)."""
    places = {name: joint for joint, name in enumerate(skeleton.names)}
    others = (next((places[other] for other in _others(name) if other in places), None) for name in places)
    return np.array([joint if other is None else other for joint, other in enumerate(others)])


def asymmetry(skeleton: Skeleton, joints: Sequence[int], usual: Array | None = None) -> str:
    """Why the mirror image is another body, for people; '' if it is this one.

    joints: the learned ones; usual (J, 4): their usual orientations, the root's without its heading.
    """
    pairs = mirror_pairs(skeleton)
    names = skeleton.names
    if all(pairs[joint] == joint for joint in joints):
        return "no joint's name says which side it is on"
    carrying = sorted({above for joint in joints for above in skeleton.ancestors(joint)})
    for joint in carrying:
        above, other = skeleton.parents[joint], skeleton.parents[pairs[joint]]
        if pairs[pairs[joint]] != joint or (above >= 0 and pairs[above] != other):
            return f"{names[joint]} and {names[pairs[joint]]} do not hang from the same place"
    unequal = _unequal_m(skeleton, pairs, _axis(skeleton, pairs))
    worst = max(carrying, key=lambda joint: unequal[joint])
    if unequal[worst] > UNEQUAL * span_m(skeleton):
        if pairs[worst] == worst:
            return f"{names[worst]} is not in the middle, and no joint is named as its other side"
        return f"{names[worst]} and {names[pairs[worst]]} are not each other's mirror image in the rest pose"
    if usual is not None:
        image = _reflected(usual, pairs, _axis(skeleton, pairs))
        apart = np.degrees(quaternion.angle_between(image, usual))
        worst = max(joints, key=lambda joint: apart[joint])
        if apart[worst] > OPPOSITE_DEGREES:
            return f"{names[worst]} and {names[pairs[worst]]} do not turn about mirrored axes"
    return ""


def mirrored(recording: Recording) -> Recording:
    """The mirrored dance: reflected in the plane between left and right, joints swapped."""
    pairs = mirror_pairs(recording.skeleton)
    axis = _axis(recording.skeleton, pairs)
    poses = _reflected(recording.poses, pairs, axis)
    return Recording(recording.skeleton, poses, recording.roots * _flip(axis), recording.fps)


def _reflected(poses: Array, pairs: NDArray[np.intp], axis: int) -> Array:
    """Orientations (..., J, 4) of the mirror image; turns about the mirror's normal stay."""
    image: Array = poses[..., pairs, :] * np.concatenate([[1.0], -_flip(axis)])
    return image


def _flip(axis: int) -> Array:
    return np.where(np.arange(3) == axis, -1.0, 1.0)


def _axis(skeleton: Skeleton, pairs: NDArray[np.intp]) -> int:
    """The axis along which left and right lie: x unless the offsets say z."""
    return min(SIDEWAYS, key=lambda axis: float(_unequal_m(skeleton, pairs, axis).sum()))


def _unequal_m(skeleton: Skeleton, pairs: NDArray[np.intp], axis: int) -> Array:
    """(J,): metres between each joint's offset and the image of its counterpart's."""
    apart: Array = np.linalg.norm(skeleton.offsets[pairs] * _flip(axis) - skeleton.offsets, axis=-1)
    return apart


def _others(name: str) -> Iterator[str]:
    """Possible names of a joint's counterpart."""
    for place in _PLACES:
        other = re.sub(place, lambda found: _OTHER[found[0]], name)
        if other != name:
            yield other
