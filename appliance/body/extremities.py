"""Hands and feet of the figure: what an audience reads from ten metres."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from appliance.body.volumes import Ball, Cut, Slab, Step, loft
from appliance.pose.anatomy import Anatomy
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array

_UP = np.array([0.0, 1.0, 0.0])
_LEVEL = np.array([1.0, 0.0, 1.0])
FINGER = (0.0072, 0.0057)  # radii at knuckle and tip, in heights
THUMB = (0.0084, 0.0062)
TIP = 0.012  # the skin goes on beyond the last bone, in heights
# From the index to the little finger of a relaxed hand: how far the tip bends to the palm, and how far it is
# to the thumb's side of the middle, in heights. The two in the middle lie against each other.
CURL = np.radians([28.0, 42.0, 46.0, 58.0])
TIPS = np.array([0.0250, 0.0054, -0.0054, -0.0222])
KNUCKLE = 0.35  # share of the bend that is at the knuckle
WEB = 0.45  # share of the finger that the palm's skin covers
MELT = 0.0026  # over how many heights fingers melt into each other
_FINGER_LONG = 0.042  # length of a finger that has no bones, in heights
_HAND = 0.105  # length of a hand whose fingers the skeleton lacks, in heights
_FOOT = 0.125

Lengths = list[tuple[int, float]]  # the bones of a finger: the joint that moves it, metres
# Towards which the thumb's first and last half bone points: along the hand, to the thumb's side, to the palm.
_THUMB_WAY = np.array([(0.80, 0.34, 0.42), (0.95, -0.12, 0.20)])


@dataclass(frozen=True)
class _Hand:
    """A hand's joint, its wrist (3,) and unit vectors (3,): along it, to the thumb's side, to the palm's."""

    joint: int
    wrist: Array
    ahead: Array
    aside: Array
    inwards: Array
    height: float

    def relaxed(self, fingers: list[tuple[Array, Lengths]], thumb: tuple[Array, Lengths]) -> list[Step]:
        """A palm, fingers that lie together and bend the more the nearer they are to the little one, and a
        thumb beside them; a finger: where its knuckle is, its bones."""
        fingers = sorted(fingers, key=lambda finger: -float(finger[0] @ self.aside))
        beside = [float((knuckle - self.wrist) @ self.aside) for knuckle, _ in fingers]
        steps: list[Step] = [
            self._board(self.wrist + 0.30 * off * self.aside, knuckle, (0.0090, 0.0073), 0.007)
            for off, (knuckle, _) in zip(beside, fingers, strict=True)
        ]
        for place, (knuckle, lengths) in enumerate(fingers):
            share = (len(CURL) - 1) * place / (len(fingers) - 1)
            bend, tip = (float(np.interp(share, range(len(CURL)), table)) for table in (CURL, TIPS))
            long = sum(length for _, length in lengths)
            fan = (float(np.mean(beside)) + tip * self.height - beside[place]) / long
            fan = float(np.clip(fan, -0.3, 0.3))
            angles = bend * (KNUCKLE + (1.0 - KNUCKLE) * ease(_middles(lengths)))
            ways = np.cos(angles) * self.ahead + np.sin(angles) * self.inwards + fan * self.aside
            steps += self._finger(_chain(knuckle, lengths, ways), FINGER)
            web = knuckle + WEB * long * ways[0]
            steps.append(self._board(knuckle, web, (0.0068, 0.0058), 0.006))
        at, lengths = thumb
        root = self.wrist + 0.30 * (at - self.wrist)
        turned = _THUMB_WAY[0] + _middles(lengths) * (_THUMB_WAY[1] - _THUMB_WAY[0])
        chain = _chain(at, lengths, turned @ [self.ahead, self.aside, self.inwards])
        steps.append(self._board(root, chain[1][1], (0.0112, 0.0088), 0.014))
        return steps + self._finger(chain, THUMB)

    def _board(self, start: Array, end: Array, radii: tuple[float, float], soft: float) -> Slab:
        first, last = np.array(radii) * self.height
        return Slab(self.joint, start, end, first, last, soft * self.height, self.aside)

    def _finger(self, chain: list[tuple[int, Array]], radii: tuple[float, float]) -> list[Step]:
        """Its bones, each a little thinner."""
        widths = self.height * np.linspace(*radii, len(chain))
        return [
            Slab(owner, start, end, float(first), float(last), MELT * self.height, self.aside)
            for ((_, start), (owner, end)), (first, last) in zip(
                pairwise(chain), pairwise(widths), strict=True
            )
        ]


def _middles(lengths: Lengths) -> Array:
    """How far along a finger the middle of each half of its bones is, 0 to 1, (halves, 1)."""
    halves = np.repeat([0.5 * length for _, length in lengths], 2)
    shares: Array = (np.cumsum(halves) - 0.5 * halves) / halves.sum()
    return shares[:, None]


def _chain(start: Array, lengths: Lengths, ways: Array) -> list[tuple[int, Array]]:
    """(joint, where it is) along a finger, each bone in two halves; ways (halves, 3): where they point."""
    chain = [(lengths[0][0], start)]
    for (owner, length), way in zip((bone for bone in lengths for _ in range(2)), ways, strict=True):
        chain.append((owner, chain[-1][1] + 0.5 * length * way / float(np.linalg.norm(way))))
    return chain


def hand(anatomy: Anatomy, joint: int) -> tuple[list[Step], list[Slab]]:
    """A palm, a thumb and fingers; where the skeleton has none, those that a relaxed hand has.

    Returns what is modelled, and the bones that move it, finger by finger.
    """
    height, wrist = anatomy.height, anatomy.positions[joint]
    thumb, *fingers = sorted(anatomy.children[joint], key=anatomy.length) or [joint]
    if len(fingers) < 2:
        return _plain_hand(anatomy, joint)
    knuckles = anatomy.positions[fingers]
    ahead, aside = knuckles.mean(axis=0) - wrist, np.linalg.svd(knuckles - knuckles.mean(axis=0))[2][0]
    if float((_furthest(anatomy, thumb, wrist) - knuckles.mean(axis=0)) @ aside) < 0.0:
        aside = -aside
    palm = np.cross(ahead, aside)
    if float(np.linalg.norm(palm)) < 1e-6 * height:  # all in the wrist, or along one line
        return _plain_hand(anatomy, joint)
    palm, ahead = palm / np.linalg.norm(palm), ahead / np.linalg.norm(ahead)
    aside = np.cross(palm, ahead)
    if float((wrist - anatomy.positions[anatomy.trunk[0]]) @ anatomy.across) < 0.0:
        palm = -palm
    modelled = _Hand(joint, wrist, ahead, aside, palm, height)
    parts = [(anatomy.positions[finger], _lengths(anatomy, finger)) for finger in (thumb, *fingers)]
    thick = FINGER[0] * height
    root = wrist + 0.30 * (parts[0][0] - wrist)
    bones = [*((wrist, knuckle) for knuckle in knuckles), (root, parts[0][0])]
    movers = [Slab(joint, *bone, thick, thick, 0.0, aside) for bone in bones]
    return modelled.relaxed(parts[1:], parts[0]), movers


def _lengths(anatomy: Anatomy, finger: int) -> Lengths:
    """The bones of a finger to the tip of its skin."""
    bones = anatomy.bones([finger, *anatomy.below(finger)])
    lengths = [(owner, float(np.linalg.norm(end - start))) for owner, start, end in bones]
    owner, last = lengths.pop() if lengths else (finger, (_FINGER_LONG - TIP) * anatomy.height)
    return [*lengths, (owner, last + TIP * anatomy.height)]


# Fingers of a relaxed hand, in lengths of the hand: knuckle (along, aside), length; then the thumb.
_RELAXED = ((0.53, 0.185, 0.43), (0.55, 0.065, 0.47), (0.53, -0.06, 0.43), (0.48, -0.175, 0.34))
_RELAXED_THUMB = ((0.16, 0.17, 0.05), 0.46)


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
    bones = [Slab(*bone, 0.01, 0.01, 0.0, aside) for bone in anatomy.bones(anatomy.below(joint))]
    mover = [Slab(joint, wrist, far, 0.01, 0.01, 0.0, aside), *bones] if bones else []
    if not anatomy.is_person:
        wide, half = np.array([0.0165, 0.0125, 0.0075]) * height, 0.016 * height
        row = wrist + 0.45 * (far - wrist)
        return [
            Slab(joint, wrist, row, wide[0], wide[1], 0.0, aside, 0.25 * half, half),
            Slab(joint, row, far, wide[1], wide[2], 0.0, aside, half, 0.6 * half),
        ], mover
    modelled = _Hand(joint, wrist, ahead, aside, inwards, height)
    axes = long * np.array([ahead, aside, inwards])
    fingers = [
        (wrist + np.array([along, across, 0.0]) @ axes, [(joint, 0.5 * share * long)] * 2)
        for along, across, share in _RELAXED
    ]
    at, share = _RELAXED_THUMB
    return modelled.relaxed(fingers, (wrist + np.array(at) @ axes, [(joint, 0.5 * share * long)] * 2)), mover


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
