"""A figure modelled around a skeleton of any kind: trunk, limbs with muscles, head, hands and feet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from appliance.body.extremities import foot, hand
from appliance.body.head import head, neck
from appliance.body.volumes import Ball, Group, Slab, Step, loft
from appliance.pose.anatomy import LONG_BONE, Anatomy
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array

_UP = np.array([0.0, 1.0, 0.0])

# Along the spine from below the pelvis to the neck (1): half the width as a share of the hips' and of the
# shoulders' half width; flesh beside it, half the depth, and how far before the bones, in heights.
_SPINE = np.array([-0.112, 0.00, 0.12, 0.24, 0.36, 0.50, 0.66, 0.80, 0.91, 1.00])
_OF_HIPS = np.array([0.05, 0.74, 0.82, 0.70, 0.40, 0.20, 0.00, 0.00, 0.00, 0.00])
_OF_SHOULDERS = np.array([0.00, 0.00, 0.00, 0.10, 0.30, 0.50, 0.72, 0.62, 0.46, 0.25])
_FLESH = np.array([0.012, 0.034, 0.037, 0.034, 0.031, 0.034, 0.036, 0.030, 0.018, 0.014])
_DEPTH = np.array([0.012, 0.045, 0.052, 0.049, 0.046, 0.053, 0.061, 0.058, 0.043, 0.030])
_AHEAD = np.array([0.000, -0.002, 0.001, 0.005, 0.008, 0.011, 0.012, 0.010, 0.002, -0.002])
# Columns of muscle along the spine and of the belly: share of the spine, aside, before it, in heights.
_BACK = ((0.06, 0.020, -0.034), (0.36, 0.018, -0.031), (0.62, 0.021, -0.036), (0.88, 0.018, -0.031))
_BELLY = ((0.12, 0.016, 0.043), (0.36, 0.018, 0.0425), (0.60, 0.022, 0.050))
_SMALL = 0.06  # heights: larger parts of a head need no small cells
_HIP = 0.047  # where the hip joints are along the spine
_BELOW = 0.057  # heights that the pelvis reaches below them


@dataclass(frozen=True)
class Sculpture:
    """The trunk, the limbs that grow out of it, and boxes (lowest, highest corner) with details that only
    small cells show."""

    trunk: Group
    limbs: tuple[Group, ...]
    details: tuple[tuple[Array, Array], ...]


def sculpture(anatomy: Anatomy) -> Sculpture:
    """The body in the skeleton's rest pose."""
    limbs, details = [], []
    for trunk, first in anatomy.limbs():
        limb, end = _limb(anatomy, trunk, first)
        limbs.append(limb)
        details.append(_box(end))
    face = head(anatomy)
    if face:
        limbs.append(Group(tuple(face), 0.012 * anatomy.height))
        small = [step for step in face if float(np.ptp(step.box, axis=0).max()) < _SMALL * anatomy.height]
        details += [_box(small)] if small else []
    body = Group((*_trunk(anatomy), *neck(anatomy), *_back_and_chest(anatomy)), 0.0)
    covered = {solid.owner for group in limbs for solid in group.movers}
    covered |= {
        mover.owner for mover in body.movers if not isinstance(mover, Slab) or mover.start is not mover.end
    }
    return Sculpture(body, (*limbs, *_twigs(anatomy, covered)), tuple(details))


def _box(steps: Sequence[Step]) -> tuple[Array, Array]:
    boxes = [step.box for step in steps if not step.removes]
    return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)


def cone(
    anatomy: Anatomy, owner: int, start: Array, end: Array, radii: tuple[float, float], softness: float
) -> Slab:
    """A rounded cone; the softness counts in heights, the radii in metres."""
    return Slab(owner, start, end, *radii, softness * anatomy.height, anatomy.across)


def _trunk(anatomy: Anatomy) -> list[Step]:
    """Sections along the spine; a single ball where nothing branches."""
    places, height = anatomy.positions, anatomy.height
    spine = _spine(anatomy)
    if len(spine) < 2:
        ball = min(anatomy.thickness(spine[0]), 0.045 * height)
        return [cone(anatomy, spine[0], places[spine[0]], places[spine[0]], (ball, ball), 0.0)]
    ends = [places[joint] for joint in spine]
    levels, marks = [0.0], [0.0]  # metres along the spine, and what they are in the tables
    if anatomy.is_person:
        up = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
        level = float(np.mean([(place - ends[0]) @ up for place in _limb_starts(anatomy, spine[0])]))
        below = max(_BELOW * height - level, 0.01 * height)
        ends.insert(0, ends[0] - below * up)
        levels, marks = [-below, level], [float(_SPINE[0]), _HIP]
        spine = [spine[0], *spine]
    lengths = np.array([float(np.linalg.norm(b - a)) for a, b in pairwise(ends)])
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    if spine[0] == spine[1]:
        begins -= lengths[0]
    whole = max(float(begins[-1]), 1e-9)
    hips, shoulders = _half_width(anatomy, spine[0]), _half_width(anatomy, spine[-2])
    pieces = max(8, round(float(lengths.sum()) / (0.012 * height)))
    along = np.linspace(begins[0], begins[-1], pieces + 1)
    axis = np.stack([np.interp(along, begins, [end[i] for end in ends]) for i in range(3)], axis=1)
    shares = np.interp(along, [*levels, whole], [*marks, 1.0])
    of_hips, of_shoulders, flesh, depth, ahead = (
        _curve(shares, _SPINE, table) for table in (_OF_HIPS, _OF_SHOULDERS, _FLESH, _DEPTH, _AHEAD)
    )
    wide = of_hips * hips + of_shoulders * shoulders + flesh * height
    deep = depth * height
    axis = axis + ahead[:, None] * height * anatomy.forward
    owners = [spine[min(int(np.searchsorted(begins, at, side="right")) - 1, len(spine) - 2)] for at in along]
    return [loft(owners, axis, wide, deep, anatomy.across, 0.0)]


def _curve(along: Array, places: Array, table: Array) -> Array:
    """A smooth curve (cubic Hermite, Catmull and Rom's slopes) through a table's values at its places."""
    slopes = np.gradient(table, places)
    right = np.clip(np.searchsorted(places, along), 1, len(places) - 1)
    left = right - 1
    step = places[right] - places[left]
    t = np.clip((along - places[left]) / step, 0.0, 1.0)
    low, high = table[left], table[right]
    curve: Array = (
        low * (1 + 2 * t) * (1 - t) ** 2
        + high * ease(t)
        + step * (slopes[left] * t * (1 - t) ** 2 - slopes[right] * t * t * (1 - t))
    )
    return curve


def _back_and_chest(anatomy: Anatomy) -> list[Step]:
    """For an upright figure: columns of muscle along the spine and of the belly, chest muscles."""
    if not anatomy.is_person:
        return []
    spine, height = _spine(anatomy), anatomy.height
    pelvis, top = (anatomy.positions[joint] for joint in (spine[0], spine[-1]))
    across, ahead = anatomy.across, anatomy.forward
    bottom, breast = spine[0], spine[-2] if len(spine) > 1 else spine[0]
    shoulders = max(_half_width(anatomy, breast), 0.05 * height)

    line = np.array([anatomy.positions[joint] for joint in spine])
    marks = np.maximum.accumulate((line - pelvis) @ (top - pelvis)) / float((top - pelvis) @ (top - pelvis))

    def at(along: float, aside: float, before: float) -> Array:
        """A place beside the spine and before it, in heights, at a share of its length."""
        bone = np.array([np.interp(along, marks, line[:, axis]) for axis in range(3)])
        there: Array = bone + height * (aside * across + before * ahead)
        return there

    def owner(along: float) -> int:
        heights = [float(anatomy.positions[joint] @ _UP) for joint in spine[:-1]]
        here = float(at(along, 0.0, 0.0) @ _UP)
        return max((j for j, y in zip(spine, heights, strict=False) if y <= here), default=bottom)

    wide = shoulders / height
    steps: list[Step] = []
    for sign in (1.0, -1.0):
        for column, thick, soft in ((_BACK, 0.0165, 0.026), (_BELLY, 0.0125, 0.014)):
            for low, high in pairwise(column):
                start, end = (at(along, sign * aside, before) for along, aside, before in (low, high))
                radii = (thick * height, thick * height)
                steps.append(cone(anatomy, owner(low[0]), start, end, radii, soft))
        inner, outer = at(0.765, sign * 0.18 * wide, 0.054), at(0.79, sign * 0.70 * wide, 0.043)
        half = 0.5 * (outer - inner)
        long = float(np.linalg.norm(half))
        axes = np.array([half / long, _UP, np.cross(sign * half / long, _UP)])
        half_axes = np.array([long + 0.014 * height, 0.0255 * height, 0.0205 * height])
        steps.append(Ball(breast, inner + half, half_axes, axes, 0.011 * height))
    steps.append(
        Ball(owner(0.2), at(0.17, 0.0, 0.030), height * np.array([0.045, 0.060, 0.026]),
             np.array([across, _UP, ahead]), 0.03 * height)
    )  # fmt: skip
    for trunk, first in anatomy.limbs():
        chain = anatomy.chain(first)
        if not _is_leg(anatomy, chain, _extremity(anatomy, chain)):  # from the nape to the shoulder
            start = anatomy.positions[chain[anatomy.limb_start(chain)]]
            aside = float((start - anatomy.positions[trunk]) @ across) * across
            nape = start - aside + height * (0.046 * _UP - 0.004 * ahead)
            ends, radii = (nape, start - 0.2 * aside), (0.012 * height, 0.016 * height)
            steps.append(Slab(trunk, *ends, *radii, 0.03 * height, across))
    return steps


def _spine(anatomy: Anatomy) -> list[int]:
    """Trunk joints from the pelvis to the furthest one, then the first joint of the neck."""
    last = anatomy.trunk[-1]
    spine = [last]
    while spine[0] != anatomy.trunk[0]:
        spine.insert(0, anatomy.skeleton.parents[spine[0]])
    if anatomy.neck and anatomy.skeleton.parents[anatomy.neck[0]] == last:
        spine.append(anatomy.neck[0])
    return spine


def _half_width(anatomy: Anatomy, joint: int) -> float:
    """How far to the side the limbs of a trunk joint begin, metres."""
    starts = _limb_starts(anatomy, joint)
    sides = [abs(float((start - anatomy.positions[joint]) @ anatomy.across)) for start in starts]
    return max(sides, default=0.03 * anatomy.height)


def _limb_starts(anatomy: Anatomy, joint: int) -> list[Array]:
    """Where the limbs of a trunk joint begin: hips, shoulders."""
    chains = [anatomy.chain(first) for trunk, first in anatomy.limbs() if trunk == joint]
    return [anatomy.positions[chain[anatomy.limb_start(chain)]] for chain in chains]


def _limb(anatomy: Anatomy, trunk: int, first: int) -> tuple[Group, list[Step]]:
    """From the trunk to the finger tips or toes, and the hand or foot of it."""
    chain = anatomy.chain(first)
    begin, last = anatomy.limb_start(chain), _extremity(anatomy, chain)
    is_leg = _is_leg(anatomy, chain, last)
    end, bones = (foot(anatomy, chain[last]), []) if is_leg else hand(anatomy, chain[last])
    steps = list(end)
    long = list(range(begin, last))
    if is_leg and anatomy.is_person and len(long) == 2:
        bones = [_hip(anatomy, chain[begin], chain[begin + 1])]
    for place in reversed(long):
        shape = _muscles_of(anatomy, chain, place, long, is_leg)
        steps += shape
    steps += _root_of_limb(anatomy, trunk, chain[: begin + 1], is_leg)
    return Group(tuple(steps), (0.026 if is_leg else 0.022) * anatomy.height, tuple(bones)), end


def _hip(anatomy: Anatomy, thigh: int, shank: int) -> Slab:
    """The volume that moves the skin with a thigh, instead of the flesh: behind and above the joint. A bend
    then stretches skin as far from the joint as the skin that it folds, and volume is kept."""
    height = anatomy.height
    start = anatomy.positions[thigh] + height * (0.030 * _UP - 0.031 * anatomy.forward)
    return cone(anatomy, thigh, start, anatomy.positions[shank], (0.05 * height, 0.04 * height), 0.0)


def _muscles_of(
    anatomy: Anatomy, chain: Sequence[int], place: int, long: Sequence[int], is_leg: bool
) -> list[Step]:
    """The flesh around one long bone: of a thigh, a shank, an upper arm, a forearm; else a tapered muscle."""
    bone = anatomy.positions[chain[place]], anatomy.positions[chain[place + 1]]
    if len(long) == 2 and anatomy.is_person:
        upper = place == long[0]
        table = (_THIGH if upper else _SHANK) if is_leg else (_UPPER_ARM if upper else _FOREARM)
        return _shaped(anatomy, chain[place], *bone, table, is_leg, 0.004 if upper else 0.012)
    return _bone(anatomy, chain[place], chain[place + 1], is_leg)


# Sections along a bone: share of it, forwards, outwards, half the width, half the depth. Muscles on it: from
# (share of the bone, forwards, outwards, radius) to the same, and the softness. In heights.
_Section = tuple[float, float, float, float, float]
_Point = tuple[float, float, float, float]
_Muscles = tuple[tuple[_Point, _Point, float], ...]


@dataclass(frozen=True)
class _Flesh:
    sections: tuple[_Section, ...]
    muscles: _Muscles


_THIGH = _Flesh(
    (
        (0.02, 0.001, -0.0030, 0.0400, 0.0460),
        (0.16, 0.003, -0.0048, 0.0450, 0.0510),
        (0.34, 0.004, -0.0040, 0.0440, 0.0510),
        (0.54, 0.004, -0.0025, 0.0400, 0.0455),
        (0.74, 0.003, -0.0008, 0.0343, 0.0390),
        (0.88, 0.002, 0.0005, 0.0308, 0.0340),
        (1.00, 0.000, 0.0000, 0.0280, 0.0294),
    ),
    (
        ((0.26, 0.016, 0.006, 0.0310), (0.84, 0.008, 0.004, 0.0120), 0.024),  # the outer front
        ((-0.08, 0.024, 0.006, 0.0120), (0.48, 0.015, 0.000, 0.0240), 0.030),  # its root
        ((0.62, 0.012, -0.013, 0.0220), (0.88, 0.012, -0.012, 0.0170), 0.020),  # drop above the knee
        ((0.28, -0.022, -0.004, 0.0280), (0.92, -0.008, -0.003, 0.0100), 0.026),  # the back
        ((0.93, 0.0195, 0.000, 0.0125), (1.02, 0.0205, 0.000, 0.0120), 0.010),  # kneecap
    ),
)
_SHANK = _Flesh(
    (
        (0.00, 0.000, 0.000, 0.0280, 0.0294),
        (0.08, -0.001, 0.000, 0.0302, 0.0314),
        (0.20, -0.005, 0.001, 0.0330, 0.0350),
        (0.32, -0.008, 0.001, 0.0342, 0.0370),
        (0.46, -0.007, 0.000, 0.0308, 0.0340),
        (0.62, -0.004, 0.000, 0.0242, 0.0270),
        (0.76, -0.003, 0.000, 0.0190, 0.0222),
        (0.88, -0.003, 0.000, 0.0164, 0.0202),
        (0.95, -0.003, 0.000, 0.0155, 0.0194),
        (1.00, -0.002, 0.000, 0.0158, 0.0190),
    ),
    (
        ((0.16, -0.020, -0.011, 0.0150), (0.40, -0.022, -0.011, 0.0160), 0.022),  # calf
        ((0.05, 0.018, -0.002, 0.0115), (0.66, 0.011, -0.002, 0.0080), 0.016),  # shin
        ((0.70, -0.015, 0.000, 0.0085), (1.00, -0.017, 0.000, 0.0080), 0.016),  # tendon
    ),
)
_UPPER_ARM = _Flesh(
    (
        (0.00, 0.000, 0.000, 0.0245, 0.0250),
        (0.18, 0.000, 0.001, 0.0260, 0.0270),
        (0.40, 0.001, 0.000, 0.0240, 0.0270),
        (0.62, 0.001, 0.000, 0.0220, 0.0265),
        (0.84, -0.001, 0.000, 0.0210, 0.0208),
        (1.00, 0.000, 0.000, 0.0220, 0.0195),
    ),
    (
        ((0.07, 0.000, 0.006, 0.0265), (0.48, 0.000, 0.004, 0.0100), 0.016),  # shoulder muscle
        ((0.38, 0.011, 0.000, 0.0165), (0.76, 0.004, 0.000, 0.0100), 0.020),  # biceps
        ((0.28, -0.012, 0.002, 0.0170), (0.76, -0.005, 0.001, 0.0100), 0.020),  # triceps
        ((0.96, -0.010, 0.000, 0.0110), (1.01, -0.0105, 0.000, 0.0105), 0.010),  # elbow
    ),
)
_FOREARM = _Flesh(
    (
        (0.00, 0.000, 0.000, 0.0220, 0.0195),
        (0.12, 0.000, 0.000, 0.0226, 0.0215),
        (0.26, 0.002, 0.000, 0.0230, 0.0232),
        (0.48, 0.002, 0.000, 0.0205, 0.0215),
        (0.70, 0.001, 0.000, 0.0154, 0.0176),
        (0.88, 0.000, 0.000, 0.0120, 0.0156),
        (1.00, 0.000, 0.000, 0.0112, 0.0150),
    ),
    (
        ((0.00, 0.001, 0.002, 0.0080), (0.36, 0.009, 0.004, 0.0120), 0.020),
        ((0.00, 0.001, -0.002, 0.0080), (0.38, 0.003, -0.007, 0.0120), 0.020),
    ),
)


def _shaped(
    anatomy: Anatomy, owner: int, start: Array, end: Array, flesh: _Flesh, is_leg: bool, softness: float
) -> list[Step]:
    """Flesh along a bone, melted into what is beyond it by `softness` heights.

    Forwards: the figure's front; outwards: away from the body's middle, of an arm that is held to the side
    upwards."""
    height = anatomy.height
    bone = end - start
    front = anatomy.forward - bone * float(anatomy.forward @ bone) / max(float(bone @ bone), 1e-12)
    if float(np.linalg.norm(front)) < 0.2:
        ends = flesh.sections[0][3] * height, flesh.sections[-1][3] * height
        return [cone(anatomy, owner, start, end, ends, 0.0)]
    front = front / np.linalg.norm(front)
    side = np.cross(front, bone / np.linalg.norm(bone))
    away = start - anatomy.positions[anatomy.trunk[0]]
    outside = anatomy.across * float(away @ anatomy.across) if is_leg else _UP + 0.2 * away
    side = side if float(side @ outside) >= 0.0 else -side
    table = np.array(flesh.sections)
    shares = np.linspace(table[0, 0], table[-1, 0], 24)
    ahead, out, wide, deep = (
        height * _curve(shares, table[:, 0], table[:, column]) for column in (1, 2, 3, 4)
    )
    axis = start + shares[:, None] * bone + ahead[:, None] * front + out[:, None] * side
    steps: list[Step] = [loft([owner] * len(axis), axis, wide, deep, side, softness * height)]
    for low, high, soft in flesh.muscles:
        a, b = (start + p[0] * bone + height * (p[1] * front + p[2] * side) for p in (low, high))
        steps.append(cone(anatomy, owner, a, b, (low[3] * height, high[3] * height), soft))
    return steps


def _bone(anatomy: Anatomy, joint: int, child: int, is_leg: bool) -> list[Step]:
    """A muscle from the joint to below its middle, and the taper to the next joint."""
    start, end = anatomy.positions[joint], anatomy.positions[child]
    first, last = anatomy.thickness(joint), anatomy.thickness(child)
    belly = start + 0.32 * (end - start)
    first = 0.9 * first if is_leg else first
    full = (first + 0.32 * (last - first)) * (1.18 if is_leg else 1.12)
    return [
        cone(anatomy, joint, belly, end, (full, last), 0.0),
        cone(anatomy, joint, start, belly, (first, full), 0.0),
    ]


def _root_of_limb(anatomy: Anatomy, trunk: int, chain: Sequence[int], is_leg: bool) -> list[Step]:
    """The parts that join a limb to the trunk: shoulder girdle and chest muscle, or hip and seat."""
    if not anatomy.is_person:
        return _plain_root(anatomy, trunk, chain, is_leg)
    places, height = anatomy.positions, anatomy.height
    start, ahead = places[chain[-1]], anatomy.forward
    away = float((start - places[trunk]) @ anatomy.across)
    out = anatomy.across * (1.0 if away >= 0 else -1.0)
    owner = chain[-2] if len(chain) > 1 else trunk
    if is_leg:
        axes, soft = np.array([out, _UP, ahead]), 0.030 * height
        seat = start + height * (-0.030 * ahead - 0.010 * out - 0.024 * _UP)
        hip = start + height * (-0.012 * out - 0.010 * _UP - 0.006 * ahead)
        trochanter = start + height * (0.006 * out - 0.014 * _UP - 0.004 * ahead)
        groin = start - 0.50 * abs(away) * out - height * (0.022 * _UP - 0.010 * ahead)
        inside = start - height * (0.130 * _UP + 0.008 * out)
        return [
            Ball(trunk, seat, height * np.array([0.042, 0.048, 0.040]), axes, soft),
            Ball(owner, hip, height * np.array([0.042, 0.052, 0.036]), axes, soft),
            Ball(chain[-1], trochanter, height * np.array([0.026, 0.054, 0.034]), axes, soft),
            cone(anatomy, chain[-1], groin, inside, (0.016 * height, 0.026 * height), 0.03),
        ]
    thick = 0.0290 * height
    inner = start - 0.85 * abs(away) * out
    notch = inner + height * (0.040 * ahead + 0.002 * _UP)
    top = start + height * (0.020 * _UP + 0.012 * ahead - 0.012 * out)
    flank = start - height * (0.165 * _UP - 0.010 * ahead) - 0.40 * abs(away) * out
    breast = start - 0.55 * abs(away) * out + height * (0.034 * ahead - 0.036 * _UP)
    blade = start - 0.45 * abs(away) * out - height * (0.022 * ahead + 0.012 * _UP)
    tip = blade + height * (0.004 * out - 0.060 * _UP - 0.004 * ahead)
    across = anatomy.across
    return [
        Slab(owner, inner, start, 0.026 * height, thick, 0.012 * height, across),
        Slab(owner, notch, top, 0.0090 * height, 0.0100 * height, 0.007 * height, across),  # collarbone
        Slab(trunk, breast, start, 0.024 * height, 0.022 * height, 0.020 * height, across),  # chest muscle
        Slab(
            trunk,
            flank,
            start - height * (0.018 * ahead + 0.004 * _UP),
            0.010 * height,
            0.018 * height,
            0.040 * height,
            across,
        ),  # broad back muscle
        Slab(owner, blade, tip, 0.015 * height, 0.006 * height, 0.034 * height, across, 0.020 * height, 0.0),
        Slab(
            owner, blade + 0.012 * height * _UP, start, 0.013 * height, 0.014 * height, 0.018 * height, across
        ),
    ]


def _plain_root(anatomy: Anatomy, trunk: int, chain: Sequence[int], is_leg: bool) -> list[Step]:
    """The same for bodies that are not upright or have no head."""
    places, height = anatomy.positions, anatomy.height
    start = places[chain[-1]]
    thick = anatomy.thickness(chain[-1])
    owner = chain[-2] if len(chain) > 1 else trunk
    inner = start - anatomy.across * 0.6 * float((start - places[trunk]) @ anatomy.across)
    if is_leg:
        seat = start - 0.022 * height * anatomy.forward + 0.4 * (inner - start)
        return [
            cone(anatomy, trunk, seat, start, (0.92 * thick, 0.85 * thick), 0.02),
            cone(anatomy, trunk, inner, start, (0.8 * thick, 0.85 * thick), 0.02),
        ]
    girdle = [
        cone(anatomy, a, places[a], places[b], (0.030 * height, 0.030 * height), 0.01)
        for a, b in pairwise([trunk, *chain])
    ]
    return [*girdle, cone(anatomy, owner, inner, start, (0.030 * height, thick), 0.015)]


def _twigs(anatomy: Anatomy, covered: set[int]) -> list[Group]:
    """Everything else that has bones: tails, ears, wings."""
    face = set(anatomy.below(anatomy.head)) if anatomy.head is not None else set()
    left = [joint for joint in range(len(anatomy.skeleton)) if joint not in covered | face]
    bones = [(*bone, anatomy.thickness(bone[0])) for bone in anatomy.bones(left)]
    for joint in sorted({bone[0] for bone in bones}):
        parent = anatomy.skeleton.parents[joint]
        if parent in covered:
            start, end = anatomy.positions[parent], anatomy.positions[joint]
            bones.append((parent, start, end, anatomy.thickness(joint)))
    return [
        Group((cone(anatomy, owner, start, end, (thick, 0.8 * thick), 0.0),), 0.015 * anatomy.height)
        for owner, start, end, thick in bones
    ]


def _extremity(anatomy: Anatomy, chain: Sequence[int]) -> int:
    """The place in a limb's chain of its hand or foot: what is named so, else behind its last long bone."""
    feet = [place for place, joint in enumerate(chain) if place and joint in anatomy.skeleton.feet]
    if feet:
        return feet[0]
    long = [p for p in range(1, len(chain)) if anatomy.length(chain[p]) > LONG_BONE * anatomy.height]
    return long[-1] if long else len(chain) - 1


def _is_leg(anatomy: Anatomy, chain: Sequence[int], last: int) -> bool:
    if any(joint in anatomy.skeleton.feet for joint in chain):
        return True
    drop = anatomy.positions[chain[0]] - anatomy.positions[chain[last]]
    return not anatomy.skeleton.feet and float(drop[1]) > 0.8 * float(np.linalg.norm(drop))
