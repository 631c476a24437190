"""The mirror image of a dance: which joints are counterparts, and whether the body is symmetric.

A joint's turns are mirrored in its own axes. Where the zero pose is a figure, these are the room's for all
joints. If it is not, as in rigs whose bones follow an axis of their joint, each joint's mirror is found from
its bones: it must bring them onto those of the counterpart. A turn about a single bone, which that
leaves open, is found from the usual pose, which is as good as symmetric.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bones import span_m
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

UNEQUAL = 0.03  # fraction of the body's span: tolerance between the two sides (a dancer's head sits 5 mm off)
OPPOSITE_DEGREES = 120.0  # a joint usually this far from its counterpart's image has other axes
NEAR_AXES_DEGREES = 25.0  # between the mean pose of a dance and a symmetric one
_PRIOR = 1e-4  # how much the usual pose weighs against the bones
_LEAST_BONE_M = 1e-3
_SAMPLES = 500  # poses of which a mean is taken
_ALONG_AXES = [
    np.eye(3)[list(order)] * signs
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(np.eye(3)[list(order)] * signs) < 0
]
SIDEWAYS = (0, 2)  # left and right are along x or along z; a mirror on the floor would be invalid

_WORDS = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R", "左": "右"}
_OTHER = {**_WORDS, **{right: left for left, right in _WORDS.items()}}
# Where a name has its side, the likeliest first: mixamorig:LeftArm, hand_left; L_Arm, arm.l.001; lShldr,
# LThumb, Bip_LHand; ArmL, ArmLT; lfoot.
_PLACES = (
    r"left|right|Left|Right|LEFT|RIGHT|左|右",
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
    mirrors = _mirrors(skeleton, pairs, usual)
    unequal = np.array(
        [_unequal_m(skeleton, pairs, mirrors, joint) if joint else 0.0 for joint in range(len(skeleton))]
    )
    worst = max(carrying, key=lambda joint: unequal[joint])
    if unequal[worst] > UNEQUAL * span_m(skeleton):
        if pairs[worst] == worst:
            return f"{names[worst]} is not in the middle, and no joint is named as its other side"
        return f"{names[worst]} and {names[pairs[worst]]} are not each other's mirror image in the rest pose"
    if usual is not None:
        usual = _with_standing_root(skeleton, usual)
        image = _reflected(skeleton, usual, pairs, mirrors)
        apart = np.degrees(quaternion.angle_between(image, usual))
        worst = max(joints, key=lambda joint: apart[joint])
        if apart[worst] > OPPOSITE_DEGREES:
            return f"{names[worst]} and {names[pairs[worst]]} do not turn about mirrored axes"
    return ""


def mirrored(recording: Recording) -> Recording:
    """The mirrored dance: reflected in the plane between left and right, joints swapped."""
    skeleton = recording.skeleton
    pairs = mirror_pairs(skeleton)
    mirrors = _mirrors(skeleton, pairs, None if skeleton.stance is None else _usual(recording))
    poses = _reflected(skeleton, recording.poses, pairs, mirrors)
    roots = -quaternion.rotate(np.broadcast_to(mirrors.room, (len(recording), 4)), recording.roots)
    return Recording(skeleton, poses, roots, recording.fps)


class _Mirrors(NamedTuple):
    """Reflections as the turns (4,) of which they are the opposite: in the room, and (J, 4) in each joint's
    axes, from the joint's own to its counterpart's."""

    room: Array
    joints: Array


def _reflected(skeleton: Skeleton, poses: Array, pairs: NDArray[np.intp], mirrors: _Mirrors) -> Array:
    """Orientations (..., J, 4) of the mirror image: the counterpart's, into and out of its axes."""
    above = np.stack([mirrors.joints[parent] if parent >= 0 else mirrors.room for parent in skeleton.parents])
    back, turn = (each.astype(poses.dtype) for each in (quaternion.inverse(above), mirrors.joints))
    shape = poses.shape
    counterparts = quaternion.multiply(np.broadcast_to(back, shape), poses[..., pairs, :])
    return quaternion.multiply(counterparts, np.broadcast_to(turn, shape))


def _mirrors(skeleton: Skeleton, pairs: NDArray[np.intp], usual: Array | None) -> _Mirrors:
    """The mirrors of the room and of each joint. usual (J, 4): orientations that are as good as symmetric."""
    if skeleton.stance is None:
        halves = [_half_turn(axis) for axis in SIDEWAYS]
        found = [_Mirrors(half, np.tile(half, (len(skeleton), 1))) for half in halves]
        return min(
            found,
            key=lambda one: sum(_unequal_m(skeleton, pairs, one, j) for j in range(1, len(skeleton))),
        )
    local = quaternion.to_matrix(_with_standing_root(skeleton, skeleton.stance if usual is None else usual))
    room = _half_turn(SIDEWAYS[0])
    found_in: list[Array] = []
    for joint, parent in enumerate(skeleton.parents):
        other = int(pairs[joint])
        above = found_in[parent] if parent >= 0 else -quaternion.to_matrix(room)
        by_pose = local[other].T @ above @ local[joint]  # brings the usual pose onto its mirror image
        wanted = _PRIOR * by_pose
        for bone, image in _bones(skeleton, pairs, joint):
            wanted = wanted + np.outer(image, bone) / max(float(bone @ bone), float(image @ image))
        left, _, right = np.linalg.svd(wanted)
        by_bones = left @ np.diag([1.0, 1.0, -np.sign(np.linalg.det(left @ right))]) @ right
        found_in.append(_along_axes(by_bones))
    return _Mirrors(room, quaternion.from_matrix(-np.stack(found_in)))


def _bones(skeleton: Skeleton, pairs: NDArray[np.intp], joint: int) -> Iterator[tuple[Array, Array]]:
    """Offsets of a joint's children, and those of the children's counterparts."""
    for child, parent in enumerate(skeleton.parents):
        if parent == joint and skeleton.parents[pairs[child]] == pairs[joint]:
            bone, image = skeleton.offsets[child], skeleton.offsets[pairs[child]]
            if min(np.linalg.norm(bone), np.linalg.norm(image)) > _LEAST_BONE_M:
                yield bone, image
    ends, others = (
        [np.array(end) for at, end in skeleton.ends if at == one] for one in (joint, int(pairs[joint]))
    )
    if len(ends) == len(others) == 1 and min(np.linalg.norm(ends), np.linalg.norm(others)) > _LEAST_BONE_M:
        yield ends[0], others[0]


def _along_axes(mirror: Array) -> Array:
    """The nearest mirror along axes, where it is near: rigs are modelled so, and dances are uneven."""
    nearest: Array = max(_ALONG_AXES, key=lambda one: float(np.sum(one * mirror)))
    cosine = (float(np.sum(nearest * mirror)) - 1.0) / 2.0
    return nearest if cosine > np.cos(np.radians(NEAR_AXES_DEGREES)) else mirror


def _usual(recording: Recording) -> Array:
    """(J, 4): the mean orientations of a dance."""
    every = recording.poses[:: max(1, len(recording) // _SAMPLES)].astype(np.float64)
    return quaternion.blend(every, np.ones(len(every)))


def _with_standing_root(skeleton: Skeleton, usual: Array) -> Array:
    """The root as it stands to the front: the heading of a joint's own axes is not the figure's."""
    return usual if skeleton.stance is None else np.concatenate([skeleton.stance[:1], usual[1:]])


def _half_turn(axis: int) -> Array:
    """Half a turn about an axis: the opposite of the reflection along it."""
    return quaternion.from_axis_angle(np.eye(3)[axis], np.pi).round()


def _unequal_m(skeleton: Skeleton, pairs: NDArray[np.intp], mirrors: _Mirrors, joint: int) -> float:
    """Metres between the offset of a joint's counterpart and its mirrored offset; not for the root."""
    image = -quaternion.rotate(mirrors.joints[skeleton.parents[joint]], skeleton.offsets[joint])
    return float(np.linalg.norm(image - skeleton.offsets[pairs[joint]]))


def _others(name: str) -> Iterator[str]:
    """Possible names of a joint's counterpart."""
    for place in _PLACES:
        other = re.sub(place, lambda found: _OTHER[found[0]], name)
        if other != name:
            yield other
