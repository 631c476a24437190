"""Hands and feet of the figure: what an audience reads from ten metres."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from appliance.body.volumes import Ball, Cut, Slab, Step, loft
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array

_UP = np.array([0.0, 1.0, 0.0])
_LEVEL = np.array([1.0, 0.0, 1.0])
FINGER = (0.0073, 0.0062)  # radii at knuckle and tip, in heights
THUMB = (0.0086, 0.0068)
CURL = 0.30  # how far the tip of a relaxed finger is on the palm's side, in lengths of the finger
FAN = 0.42  # how far the outer fingers spread, metres aside for each metre from the knuckle
THUMB_AWAY = 0.26
TIP = 0.008  # the skin goes on beyond the last bone, in heights
WEB = 0.16  # share of the finger that the palm's skin covers
_HAND = 0.105  # length of a hand whose fingers the skeleton lacks, in heights
_FOOT = 0.125


def hand(anatomy: Anatomy, joint: int) -> tuple[list[Step], list[Slab]]:
    """A palm, a thumb and fingers; where the skeleton has none, those that a relaxed hand has.

    Returns what is modelled, and the bones that move it, finger by finger.
    """
    height, wrist = anatomy.height, anatomy.positions[joint]
    thumb, *fingers = sorted(anatomy.children[joint], key=anatomy.length) or [joint]
    if len(fingers) < 2:
        return _plain_hand(anatomy, joint)
    knuckles = anatomy.positions[fingers]
    aside = np.linalg.svd(knuckles - knuckles.mean(axis=0))[2][0]
    if float((_furthest(anatomy, thumb, wrist) - knuckles.mean(axis=0)) @ aside) < 0.0:
        aside = -aside
    palm = np.cross(knuckles.mean(axis=0) - wrist, aside)
    if float(np.linalg.norm(palm)) < 1e-6 * height:  # all in the wrist, or along one line
        return _plain_hand(anatomy, joint)
    palm = palm / np.linalg.norm(palm)
    if float((wrist - anatomy.positions[anatomy.trunk[0]]) @ anatomy.across) < 0.0:
        palm = -palm
    steps: list[Step] = []
    middle = float((knuckles @ aside).mean())
    half = max(0.5 * float(np.ptp(knuckles @ aside)), 1e-6)
    bones = [(joint, wrist, knuckle) for knuckle in knuckles]
    ways = np.array([_furthest(anatomy, *at) for at in zip(fingers, knuckles, strict=True)]) - knuckles
    spread = ways @ aside / np.maximum(np.linalg.norm(ways, axis=1), 1e-9)
    chains: list[tuple[list[tuple[int, Array]], Array]] = []
    for finger, knuckle, own in zip(fingers, knuckles, spread, strict=True):
        fan = FAN * (float(knuckle @ aside) - middle) / half + float(spread.mean() - own)
        chain = _relaxed(anatomy, finger, knuckle, fan * aside, CURL * palm)
        chains.append((chain, knuckle))
    steps += _palm(joint, wrist, [knuckle for _, knuckle in chains], aside, height)
    for chain, knuckle in chains:
        steps += _finger(chain, FINGER, height, aside)
        web = knuckle + WEB * (chain[-1][1] - knuckle)
        steps.append(Slab(joint, knuckle, web, 0.0068 * height, 0.0058 * height, 0.005 * height, aside))
    thumb_at = anatomy.positions[thumb]
    base = wrist + 0.30 * (thumb_at - wrist)
    chain = _relaxed(anatomy, thumb, base, THUMB_AWAY * aside, 0.3 * CURL * palm)
    steps.append(Slab(joint, base, chain[0][1], 0.0125 * height, 0.0100 * height, 0.014 * height, aside))
    steps += _finger(chain, THUMB, height, aside)
    thick = FINGER[0] * height
    bones.append((joint, base, thumb_at))
    return steps, [Slab(*bone, thick, thick, 0.0, aside) for bone in bones]


def _palm(joint: int, wrist: Array, knuckles: list[Array], aside: Array, height: float) -> list[Step]:
    """Wrist and one bone of the hand for each finger, melted into a palm."""
    steps: list[Step] = []
    for knuckle in knuckles:
        start = wrist + 0.35 * float((knuckle - wrist) @ aside) * aside
        steps.append(Slab(joint, start, knuckle, 0.0096 * height, 0.0076 * height, 0.007 * height, aside))
    return steps


def _relaxed(anatomy: Anatomy, finger: int, base: Array, fan: Array, curl: Array) -> list[tuple[int, Array]]:
    """(joint, where it is) along a finger with its tip, each bone in two halves.

    fan (3,): metres aside for each metre from `base`; curl (3,): the tip's way to the palm in lengths."""
    bones = anatomy.bones([finger, *anatomy.below(finger)])
    if not bones:
        return [(finger, anatomy.positions[finger])] * 2
    owner, last, tip = bones[-1]
    way = (tip - last) / max(float(np.linalg.norm(tip - last)), 1e-9)
    bones[-1] = owner, last, tip + TIP * anatomy.height * way
    points = [(bones[0][0], bones[0][1])]
    for owner, start, end in bones:
        points += [(owner, 0.5 * (start + end)), (owner, end)]
    first, whole = points[0][1], max(float(np.linalg.norm(points[-1][1] - points[0][1])), 1e-9)

    def bent(place: Array) -> Array:
        along = float(np.linalg.norm(place - first))
        there: Array = place + fan * float(np.linalg.norm(place - base)) + curl * along * along / whole
        return there

    return [(owner, bent(place)) for owner, place in points]


def _finger(
    chain: list[tuple[int, Array]], radii: tuple[float, float], height: float, aside: Array
) -> list[Step]:
    """Its bones, each a little thinner."""
    widths = height * np.linspace(*radii, len(chain))
    return [
        Slab(owner, start, end, float(first), float(last), 0.0, aside)
        for ((_, start), (owner, end)), (first, last) in zip(pairwise(chain), pairwise(widths), strict=True)
    ]


# Fingers of a relaxed hand, in lengths of the hand: knuckle (along, aside), tip (along, aside, inwards).
_RELAXED = (
    ((0.50, 0.22), (0.92, 0.33, 0.10)),
    ((0.53, 0.08), (1.00, 0.11, 0.13)),
    ((0.51, -0.07), (0.94, -0.12, 0.15)),
    ((0.46, -0.20), (0.80, -0.34, 0.15)),
)
_RELAXED_THUMB = ((0.12, 0.10, 0.03), (0.34, 0.34, 0.10), (0.56, 0.51, 0.13))


def _plain_hand(anatomy: Anatomy, joint: int) -> tuple[list[Step], list[Slab]]:
    """A relaxed hand where the skeleton has no fingers, along the bones that end there."""
    height, wrist = anatomy.height, anatomy.positions[joint]
    far = _furthest(anatomy, joint, wrist)
    if float(np.linalg.norm(far - wrist)) < 0.03 * height:
        bone = wrist - anatomy.positions[anatomy.skeleton.parents[joint]]
        far = wrist + _HAND * height * bone / max(float(np.linalg.norm(bone)), 1e-9)
    long = max(float(np.linalg.norm(far - wrist)), 1e-9)
    ahead = (far - wrist) / long
    aside = anatomy.forward - ahead * float(anatomy.forward @ ahead)
    if float(np.linalg.norm(aside)) < 1e-3:
        aside = np.cross(ahead, anatomy.across)
    aside = aside / max(float(np.linalg.norm(aside)), 1e-9)
    inwards = np.cross(ahead, aside)
    inwards = inwards if float(inwards @ _UP) <= 0.0 else -inwards

    def at(along: float, across: float, inside: float = 0.0) -> Array:
        there: Array = wrist + long * (along * ahead + across * aside + inside * inwards)
        return there

    bones = [Slab(*bone, 0.01, 0.01, 0.0, aside) for bone in anatomy.bones(anatomy.below(joint))]
    mover = [Slab(joint, wrist, far, 0.01, 0.01, 0.0, aside), *bones] if bones else []
    if not anatomy.is_person:
        wide, half = np.array([0.0165, 0.0125, 0.0075]) * height, 0.016 * height
        row = wrist + 0.45 * (far - wrist)
        return [
            Slab(joint, wrist, row, wide[0], wide[1], 0.0, aside, 0.25 * half, half),
            Slab(joint, row, far, wide[1], wide[2], 0.0, aside, half, 0.6 * half),
        ], mover
    knuckles = [at(*knuckle) for knuckle, _ in _RELAXED]
    steps = _palm(joint, wrist, knuckles, aside, height)
    for knuckle, (_, tip) in zip(knuckles, _RELAXED, strict=True):
        bend = 0.5 * (knuckle + at(*tip)) - 0.02 * long * inwards
        steps += _finger([(joint, knuckle), (joint, bend), (joint, at(*tip))], FINGER, height, aside)
        web = knuckle + WEB * (at(*tip) - knuckle)
        steps.append(Slab(joint, knuckle, web, 0.0068 * height, 0.0058 * height, 0.005 * height, aside))
    root, middle, tip_at = (at(*place) for place in _RELAXED_THUMB)
    steps.append(Slab(joint, root, middle, 0.0120 * height, 0.0085 * height, 0.014 * height, aside))
    steps += _finger([(joint, middle), (joint, tip_at)], THUMB, height, aside)
    return steps, mover


# Sections across a foot: share of the way from the ankle to the toes' joint or end; outwards, half the width,
# above the sole, half the depth, in heights.
_SOLE = (
    (-0.24, 0.000, 0.0162, 0.0140, 0.0170),
    (0.00, 0.000, 0.0165, 0.0160, 0.0190),
    (0.26, 0.000, 0.0172, 0.0140, 0.0180),
    (0.50, 0.001, 0.0212, 0.0105, 0.0150),
    (0.70, 0.001, 0.0250, 0.0080, 0.0125),
    (0.88, -0.0005, 0.0235, 0.0062, 0.0095),
    (1.04, -0.005, 0.0160, 0.0056, 0.0075),
    (1.12, -0.009, 0.0105, 0.0054, 0.0066),
)
# Toes: outwards, how far beyond the skeleton's foot, thickness; in heights.
_TOES = (
    (-0.0165, 0.0195, 0.0084),
    (-0.0035, 0.0180, 0.0066),
    (0.0060, 0.0135, 0.0062),
    (0.0145, 0.0065, 0.0060),
    (0.0208, -0.0030, 0.0058),
)


def foot(anatomy: Anatomy, joint: int) -> list[Step]:
    """Heel, arch, instep, ankle bones and five toes over a flat sole."""
    height, ankle = anatomy.height, anatomy.positions[joint]
    toes = _furthest(anatomy, joint, ankle)
    if float(np.linalg.norm((toes - ankle) * _LEVEL)) < 0.02 * height:
        toes = ankle + 0.08 * height * anatomy.forward - 0.026 * height * _UP
    ahead = (toes - ankle) * _LEVEL / np.linalg.norm((toes - ankle) * _LEVEL)
    outwards = np.cross(_UP, ahead)
    if float((ankle - anatomy.positions[anatomy.trunk[0]]) @ outwards) < 0.0:
        outwards = -outwards
    sole = min(float(toes[1]), float(ankle[1]) - 0.026 * height) - 0.008 * height
    mover = next(iter(bone[0] for bone in anatomy.bones(anatomy.children[joint])), joint)
    long = float(np.linalg.norm((toes - ankle) * _LEVEL))

    def at(forward: float, out: float, above: float) -> Array:
        """A place before the ankle, beside it, above the sole; in heights."""
        there: Array = ankle + height * (forward * ahead + out * outwards)
        there[1] = sole + above * height
        return there

    def part(a: Array, b: Array, radii: tuple[float, float], soft: float, owner: int = joint) -> Slab:
        first, last = np.array(radii) * height
        return Slab(owner, a, b, first, last, soft * height, outwards)

    length = long / height
    ball = 0.70 * length
    high = (float(ankle[1]) - sole) / height
    owners = [joint if share <= 0.70 else mover for share, *_ in _SOLE]
    shares, out, wide, middle, deep = np.array(_SOLE).T
    line = np.array([at(*place) for place in zip(shares * length, out, middle, strict=True)])
    steps: list[Step] = [
        loft(owners, line, wide * height, deep * height, outwards, 0.010 * height),
        part(ankle, at(-0.018, 0.0, 0.018), (0.0150, 0.0170), 0.012),  # heel
        part(at(-0.014, 0.0, high), at(-0.024, 0.0, 0.022), (0.0085, 0.0130), 0.012),  # tendon
        part(ankle, at(ball, -0.008, 0.0100), (0.0150, 0.0110), 0.018),  # instep
    ]
    for sign, before, above in ((-1.0, 0.003, 0.005), (1.0, -0.003, 0.000)):  # ankle bones
        steps.append(
            Ball(joint, at(before, sign * 0.0140, high + above), height * np.array([0.0095, 0.011, 0.0075]),
                 np.array([ahead, _UP, outwards]), 0.007 * height)
        )  # fmt: skip
    for out_at, far, thick in _TOES:
        start = at(ball + 0.004, 0.9 * out_at, 0.0085)
        tip = at(length + far - thick, out_at, thick)
        steps.append(part(start, tip, (thick, thick), 0.007, mover))
    arch = at(0.30 * length, -0.030, -0.002)
    steps.append(
        Ball(joint, arch, height * np.array([0.024, 0.013, 0.012]),
             np.array([ahead, _UP, outwards]), 0.012 * height, removes=True)
    )  # fmt: skip
    steps.append(Cut(at(0.0, 0.0, 0.0), -_UP, 0.16 * height, 0.006 * height))
    return steps


def _furthest(anatomy: Anatomy, joint: int, place: Array) -> Array:
    """The end of a bone of a joint, or below it, that is furthest from a place; without bones the joint."""
    ends = [bone[2] for bone in anatomy.bones([joint, *anatomy.below(joint)])]
    return max(ends, key=lambda end: float(np.linalg.norm(end - place)), default=anatomy.positions[joint])
