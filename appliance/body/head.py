"""The head of the figure: skull, brow, nose, jaw and ears, on a neck with its two muscles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from appliance.body.volumes import Ball, Slab, Step, loft
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array

_UP = np.array([0.0, 1.0, 0.0])
_REACH = 0.115  # from the head joint to the crown, where the skeleton does not say
_NECK = 0.0292  # radius

# Places as (to the front, upwards, to the side) from the middle of the head, radii and softness, in heights.
Place = tuple[float, float, float]
_BALLS: tuple[tuple[Place, Place, float], ...] = (
    ((-0.008, 0.010, 0.0), (0.0520, 0.0490, 0.0445), 0.0),  # cranium
    ((0.016, 0.008, 0.0), (0.0370, 0.0400, 0.0400), 0.020),  # forehead
    ((-0.032, -0.004, 0.0), (0.0270, 0.0330, 0.0340), 0.020),  # back of the head
)
# The face below the forehead, from temple to chin: upwards, to the front, half the width, half the depth.
_FACE = np.array(
    [
        (0.016, 0.010, 0.0388, 0.0405),
        (0.000, 0.011, 0.0396, 0.0390),
        (-0.016, 0.011, 0.0388, 0.0388),
        (-0.030, 0.012, 0.0362, 0.0378),
        (-0.044, 0.015, 0.0312, 0.0338),
        (-0.055, 0.021, 0.0232, 0.0260),
        (-0.062, 0.027, 0.0155, 0.0165),
    ]
)
_JAWS: tuple[tuple[Place, Place, float], ...] = (
    ((0.0425, -0.0595, 0.0), (0.0115, 0.0100, 0.0135), 0.010),  # chin
    ((0.0400, -0.0390, 0.0), (0.0115, 0.0110, 0.0180), 0.012),  # upper jaw
)
_BALLS_BY_SIDE: tuple[tuple[Place, Place, float], ...] = (
    ((0.0300, -0.0170, 0.0265), (0.0145, 0.0100, 0.0110), 0.018),  # cheekbone
    ((0.0250, -0.0360, 0.0195), (0.0180, 0.0170, 0.0135), 0.018),  # cheek
    ((-0.0085, -0.0110, 0.0440), (0.0105, 0.0165, 0.0055), 0.004),  # ear
)
_SLABS_BY_SIDE: tuple[tuple[Place, Place, tuple[float, float], float], ...] = (
    ((0.0010, -0.0375, 0.0305), (0.0360, -0.0610, 0.0100), (0.0090, 0.0080), 0.016),  # jaw
    ((0.0470, 0.0045, 0.0070), (0.0362, 0.0035, 0.0320), (0.0070, 0.0060), 0.014),  # brow
)
_SOCKET: tuple[Place, Place, float] = ((0.0600, -0.0090, 0.0195), (0.0098, 0.0062, 0.0110), 0.015)
_LID: tuple[Place, Place, float] = ((0.0345, -0.0100, 0.0185), (0.0142, 0.0082, 0.0125), 0.005)
_NOSE: tuple[tuple[Place, Place, tuple[float, float], float], ...] = (
    ((0.0488, 0.0010, 0.0), (0.0586, -0.0262, 0.0), (0.0048, 0.0057), 0.011),  # ridge
    ((0.0560, -0.0280, 0.0), (0.0490, -0.0385, 0.0), (0.0043, 0.0040), 0.006),  # below it
)
_WING = ((0.0510, -0.0280, 0.0064), (0.0064, 0.0052, 0.0050), 0.006)
_LIPS: tuple[tuple[Place, Place, float], ...] = (
    ((0.0488, -0.0400, 0.0), (0.0076, 0.0038, 0.0145), 0.004),
    ((0.0484, -0.0480, 0.0), (0.0072, 0.0040, 0.0115), 0.004),
)


def head(anatomy: Anatomy) -> list[Step]:
    """A skull with a face and ears; of an animal a muzzle; empty without a head."""
    joint = anatomy.head
    if joint is None:
        return []
    height = anatomy.height
    frame = head_frame(anatomy)
    if frame is None:
        up, reach = _head_axis(anatomy, joint)
        place = anatomy.positions[joint]
        ends = place, place + max(reach, 0.05 * height) * up
        return [Slab(joint, *ends, 0.048 * height, 0.030 * height, 0.0, anatomy.across)]
    middle, axes = frame
    side = axes[2]

    def at(place: Place, mirrored: float = 1.0) -> Array:
        there: Array = middle + height * (np.array(place) * [1.0, 1.0, mirrored]) @ axes
        return there

    def ball(shape: tuple[Place, Place, float], mirrored: float = 1.0, removes: bool = False) -> Ball:
        place, radii, softness = shape
        return Ball(joint, at(place, mirrored), height * np.array(radii), axes, softness * height, removes)

    def slab(shape: tuple[Place, Place, tuple[float, float], float], mirrored: float = 1.0) -> Slab:
        low, high, radii, softness = shape
        first, last = np.array(radii) * height
        return Slab(joint, at(low, mirrored), at(high, mirrored), first, last, softness * height, side)

    both = (1.0, -1.0)
    steps: list[Step] = [ball(shape) for shape in _BALLS]
    levels, ahead, wide, deep = (height * _FACE).T
    line = middle + levels[:, None] * axes[1] + ahead[:, None] * axes[0]
    steps.append(loft([joint] * len(line), line, wide, deep, side, 0.020 * height))
    steps += [ball(shape) for shape in _JAWS]
    steps += [slab(shape, sign) for shape in _SLABS_BY_SIDE for sign in both]
    steps += [ball(shape, sign) for shape in _BALLS_BY_SIDE for sign in both]
    steps += [ball(_SOCKET, sign, removes=True) for sign in both]
    steps += [ball(_LID, sign) for sign in both]
    steps += [*map(slab, _NOSE), *(ball(_WING, sign) for sign in both), *map(ball, _LIPS)]
    return steps


def head_frame(anatomy: Anatomy) -> tuple[Array, Array] | None:
    """The middle of a person's head (3,), metres, and its axes (3, 3): to the front, upwards, to the side.

    None without a head, or if it is not a person's.
    """
    if anatomy.head is None or not anatomy.is_person:
        return None
    height = anatomy.height
    up, reach = _head_axis(anatomy, anatomy.head)
    front = np.cross(anatomy.across, up)
    front = front / np.linalg.norm(front)
    front = front if float(front @ anatomy.forward) >= 0 else -front
    above = min(max(reach - 0.055 * height, 0.03 * height), 0.058 * height)
    return anatomy.positions[anatomy.head] + above * up, np.array([front, up, np.cross(up, front)])


def neck(anatomy: Anatomy) -> list[Step]:
    """From the trunk into the skull, and the muscle from behind each ear to the collarbones."""
    height, places, joints = anatomy.height, anatomy.positions, anatomy.neck
    if not joints:
        return []
    radius, soft = _NECK * height, 0.012 * height
    steps: list[Step] = []
    base = anatomy.skeleton.parents[joints[0]]
    if base >= 0:
        low = places[joints[0]] + 0.35 * (places[base] - places[joints[0]])
        steps.append(Slab(base, low, places[joints[0]], 1.35 * radius, 1.08 * radius, soft, anatomy.across))
    for owner, top in pairwise(joints):
        steps.append(Slab(owner, places[owner], places[top], 1.05 * radius, radius, soft, anatomy.across))
    last, first = joints[-1], joints[0]
    up, _ = _head_axis(anatomy, last)
    into = places[last] + 0.035 * height * up - 0.006 * height * anatomy.forward
    steps.append(Slab(last, places[last], into, radius, 0.84 * radius, soft, anatomy.across))
    nape = places[last] + height * (0.028 * up - 0.024 * anatomy.forward)
    behind = places[first] - 0.010 * height * anatomy.forward
    steps.append(Slab(first, behind, nape, 0.024 * height, 0.017 * height, 0.024 * height, anatomy.across))
    pit = places[first] + (0.032 * anatomy.forward - 0.012 * _UP) * height
    throat = places[last] + (0.009 * anatomy.forward + 0.010 * up) * height
    steps.append(Slab(first, pit, throat, 0.0100 * height, 0.0115 * height, 0.020 * height, anatomy.across))
    for sign in (1.0, -1.0):
        ear = places[last] + (0.022 * up + sign * 0.027 * anatomy.across - 0.014 * anatomy.forward) * height
        breast = pit + sign * 0.012 * height * anatomy.across
        steps.append(
            Slab(first, breast, ear, 0.0070 * height, 0.0075 * height, 0.014 * height, anatomy.across)
        )
    return steps


def _head_axis(anatomy: Anatomy, joint: int) -> tuple[Array, float]:
    """Unit vector from the head joint to the crown, and how far that is, metres."""
    place = anatomy.positions[joint]
    for _, _, end in anatomy.bones([joint]):
        reach = float(np.linalg.norm(end - place))
        if reach > 0.04 * anatomy.height and abs(float((end - place) @ anatomy.across)) < 0.2 * reach:
            return (end - place) / reach, reach
    parent = anatomy.skeleton.parents[joint]
    bone = place - anatomy.positions[parent] if parent >= 0 else _UP
    if float(bone @ _UP) > 0.5 * float(np.linalg.norm(bone)):
        bone = _UP
    return bone / max(float(np.linalg.norm(bone)), 1e-9), _REACH * anatomy.height
