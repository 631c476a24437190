"""Head, hands and feet of the figure: what an audience reads from ten metres."""

from __future__ import annotations

import numpy as np

from appliance.body.volumes import Cut, Slab
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array

_UP = np.array([0.0, 1.0, 0.0])
_LEVEL = np.array([1.0, 0.0, 1.0])
# The head, in heights: places as (to the front, upwards) from its middle, radii, halves to the sides.
_CRANIUM = ((-0.018, 0.010), (0.012, 0.004), (0.052, 0.049), (0.000, 0.000))
_JAW = ((0.006, -0.014), (0.032, -0.064), (0.040, 0.018), (0.002, 0.005))
_RIDGE = ((0.048, 0.014), (0.059, -0.020), (0.006, 0.008), (0.000, 0.000))
_FACE_AT, _FACE_TURNED = 0.050, 0.42  # the two halves of the face: how far before the middle, how turned
PALM = 0.3  # share of the fingers that belongs to the palm; with less they are claws
CLOSED = 0.5  # share of the fingers' spread at rest that is taken away
THUMB_AWAY = 0.3  # metres aside for each metre from its base: else it is lost beside the palm
_REACH = 0.115  # from the head joint to the crown, where the skeleton does not say


def head(anatomy: Anatomy) -> list[Slab | Cut]:
    """A skull with a jaw and a face of two planes that meet in a ridge; empty without a head."""
    joint = anatomy.head
    if joint is None:
        return []
    height, side = anatomy.height, anatomy.across
    up, reach = _head_axis(anatomy, joint)
    front = np.cross(side, up)
    front = front if float(front @ anatomy.forward) >= 0 else -front
    middle = anatomy.positions[joint] + min(max(reach - 0.055 * height, 0.03 * height), 0.062 * height) * up

    def at(forward: float, above: float) -> Array:
        there: Array = middle + height * (forward * front + above * up)
        return there

    def part(shape: tuple[tuple[float, float], ...], softness: float) -> Slab:
        low, high, radii, halves = shape
        return Slab(
            joint,
            at(*low),
            at(*high),
            radii[0] * height,
            radii[1] * height,
            softness * height,
            side,
            halves[0] * height,
            halves[1] * height,
        )

    planes: list[Slab | Cut] = []
    for turned in (-_FACE_TURNED, _FACE_TURNED):
        normal = front + turned * side + 0.10 * up
        planes.append(Cut(at(_FACE_AT, 0.0), normal / np.linalg.norm(normal), 0.10 * height, 0.010 * height))
    return [part(_CRANIUM, 0.0), part(_JAW, 0.022), *planes, part(_RIDGE, 0.008)]


def hand(anatomy: Anatomy, joint: int) -> tuple[list[Slab | Cut], list[Slab]]:
    """A palm, a thumb that stands off, and two groups of fingers; without fingers a mitten.

    Returns what is modelled, and the bones that move it, finger by finger.
    """
    height, wrist = anatomy.height, anatomy.positions[joint]
    thumb, *fingers = sorted(anatomy.children[joint], key=anatomy.length) or [joint]
    if len(fingers) < 2:
        return _plain_hand(anatomy, joint)
    knuckles, thumb_at = anatomy.positions[fingers], anatomy.positions[thumb]
    tips = np.array([_furthest(anatomy, finger, wrist) for finger in fingers])
    aside = np.linalg.svd(knuckles - knuckles.mean(axis=0))[2][0]
    tips -= CLOSED * np.outer((tips - knuckles) @ aside, aside)
    row = (1 - PALM) * knuckles + PALM * tips
    if float((_furthest(anatomy, thumb, wrist) - row.mean(axis=0)) @ aside) < 0.0:
        aside = -aside
    thick, half = 0.0115 * height, 0.5 * float(np.ptp(knuckles @ aside))
    base = wrist + 0.35 * (thumb_at - wrist)
    steps: list[Slab | Cut] = [
        Slab(joint, wrist, row.mean(axis=0), 0.0160 * height, thick, 0.0, aside, 0.2 * half, half)
    ]
    by_place = np.argsort(row @ aside)
    for group in (by_place[: len(fingers) // 2], by_place[len(fingers) // 2 :]):
        start, end = row[group].mean(axis=0), tips[group].mean(axis=0)
        end = end + 0.012 * height * (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        halves = [0.5 * float(np.ptp(places @ aside)) for places in (row[group], tips[group])]
        steps.append(Slab(joint, start, end, thick, 0.009 * height, 0.0, aside, halves[0], 0.5 * halves[1]))
    steps.append(Slab(joint, base, thumb_at, 0.014 * height, thick, 0.012 * height, aside))
    for owner, *ends in anatomy.bones([thumb, *anatomy.below(thumb)]):
        start, end = (place + THUMB_AWAY * float(np.linalg.norm(place - base)) * aside for place in ends)
        steps.append(Slab(owner, start, end, thick, 0.0095 * height, 0.006 * height, aside))
    bones = [(joint, wrist, knuckle) for knuckle in knuckles] + [(joint, base, thumb_at)]
    bones += anatomy.bones(anatomy.below(joint))
    return steps, [Slab(*bone, thick, thick, 0.0, aside) for bone in bones]


def _plain_hand(anatomy: Anatomy, joint: int) -> tuple[list[Slab | Cut], list[Slab]]:
    """A mitten where the skeleton has no fingers, along the bones that end there."""
    height, wrist = anatomy.height, anatomy.positions[joint]
    far = _furthest(anatomy, joint, wrist)
    if float(np.linalg.norm(far - wrist)) < 0.03 * height:
        bone = wrist - anatomy.positions[anatomy.skeleton.parents[joint]]
        far = wrist + 0.09 * height * bone / max(float(np.linalg.norm(bone)), 1e-9)
    direction = (far - wrist) / np.linalg.norm(far - wrist)
    aside = anatomy.forward - direction * float(anatomy.forward @ direction)
    aside = aside / max(float(np.linalg.norm(aside)), 1e-9)
    row = wrist + 0.45 * (far - wrist)
    wide, thick = 0.016 * height, 0.0125 * height
    bones = [Slab(*bone, thick, thick, 0.0, aside) for bone in anatomy.bones(anatomy.below(joint))]
    return [
        Slab(joint, wrist, row, 0.0165 * height, thick, 0.0, aside, 0.25 * wide, wide),
        Slab(joint, row, far, thick, 0.0075 * height, 0.0, aside, wide, 0.6 * wide),
    ], [Slab(joint, wrist, row if bones else far, thick, thick, 0.0, aside), *bones]


def foot(anatomy: Anatomy, joint: int) -> list[Slab | Cut]:
    """Heel, instep and toes over a flat sole."""
    height, ankle = anatomy.height, anatomy.positions[joint]
    toes = _furthest(anatomy, joint, ankle)
    if float(np.linalg.norm((toes - ankle) * _LEVEL)) < 0.02 * height:
        toes = ankle + 0.08 * height * anatomy.forward - 0.026 * height * _UP
    ahead = (toes - ankle) * _LEVEL / np.linalg.norm((toes - ankle) * _LEVEL)
    aside = np.cross(_UP, ahead)
    sole = min(float(toes[1]), float(ankle[1]) - 0.020 * height) - 0.008 * height

    def at(place: Array, forward: float, above_sole: float) -> Array:
        there: Array = place + forward * height * ahead
        there[1] = sole + above_sole * height
        return there

    def part(owner: int, a: Array, b: Array, radii: tuple[float, float], halves: tuple[float, float]) -> Slab:
        (first, last), (one, other) = np.array([radii, halves]) * height
        return Slab(owner, a, b, first, last, 0.008 * height, aside, one, other)

    ball, tip = at(ankle + 0.72 * (toes - ankle), 0.0, 0.014), at(toes, 0.012, 0.010)
    heel = at(ankle, -0.018, 0.020)
    mover = next(iter(bone[0] for bone in anatomy.bones(anatomy.children[joint])), joint)
    return [
        part(joint, ankle, heel, (0.018, 0.020), (0.0, 0.0)),
        part(joint, ankle + 0.004 * height * ahead, ball, (0.019, 0.014), (0.0, 0.013)),
        part(joint, heel, 0.5 * (ankle + ball), (0.018, 0.017), (0.002, 0.006)),
        part(mover, ball, tip, (0.014, 0.009), (0.013, 0.011)),
        Cut(at(ankle, 0.0, 0.0), -_UP, 0.14 * height, 0.006 * height),
    ]


def _furthest(anatomy: Anatomy, joint: int, place: Array) -> Array:
    """The end of a bone of a joint, or below it, that is furthest from a place; without bones the joint."""
    ends = [bone[2] for bone in anatomy.bones([joint, *anatomy.below(joint)])]
    return max(ends, key=lambda end: float(np.linalg.norm(end - place)), default=anatomy.positions[joint])


def _head_axis(anatomy: Anatomy, joint: int) -> tuple[Array, float]:
    """Unit vector from the head joint to the crown, and how far that is, metres."""
    place = anatomy.positions[joint]
    for _, _, end in anatomy.bones([joint]):
        reach = float(np.linalg.norm(end - place))
        if reach > 0.04 * anatomy.height and abs(float((end - place) @ anatomy.across)) < 0.2 * reach:
            return (end - place) / reach, reach
    parent = anatomy.skeleton.parents[joint]
    neck = place - anatomy.positions[parent] if parent >= 0 else _UP
    if float(neck @ _UP) > 0.5 * float(np.linalg.norm(neck)):
        neck = _UP
    return neck / max(float(np.linalg.norm(neck)), 1e-9), _REACH * anatomy.height
