"""Head, hands and feet of the figure: what an audience reads from ten metres."""

from __future__ import annotations

import numpy as np

from appliance.pose.quaternion import Array
from appliance.projector.anatomy import Anatomy
from appliance.projector.volumes import Cut, Slab

_UP = np.array([0.0, 1.0, 0.0])


def head(anatomy: Anatomy) -> list[Slab | Cut]:
    """A skull with a jaw and a flat face with a ridge, turned to the front; empty without a head."""
    joint = anatomy.head
    if joint is None:
        return []
    height, place = anatomy.height, anatomy.positions[joint]
    up, reach = _head_axis(anatomy, joint)
    side = anatomy.across
    front = np.cross(side, up)
    front = front if float(front @ anatomy.forward) >= 0 else -front
    middle = place + min(max(reach - 0.05 * height, 0.03 * height), 0.06 * height) * up

    def at(forward: float, above: float) -> Array:
        there: Array = middle + height * (forward * front + above * up)
        return there

    def part(
        a: Array, b: Array, radii: tuple[float, float], halves: tuple[float, float], soft: float
    ) -> Slab:
        return Slab(
            joint, a, b, radii[0] * height, radii[1] * height, soft * height, side,
            halves[0] * height, halves[1] * height,
        )  # fmt: skip

    face = front - 0.06 * up
    return [
        part(at(-0.016, 0.008), at(0.010, 0.010), (0.047, 0.044), (0.001, 0.001), 0.0),
        part(at(0.008, -0.012), at(0.024, -0.048), (0.036, 0.016), (0.003, 0.008), 0.020),
        Cut(at(0.047, 0.0), face / np.linalg.norm(face), 0.09 * height, 0.012 * height),
        part(at(0.043, 0.010), at(0.052, -0.016), (0.005, 0.006), (0.0, 0.0), 0.006),
    ]


def hand(anatomy: Anatomy, joint: int) -> list[Slab | Cut]:
    """A palm, and fingers that lie close: a mitten with a thumb where the skeleton has one."""
    height, wrist = anatomy.height, anatomy.positions[joint]
    below = anatomy.children[joint]
    thick = 0.0115 * height
    if len(below) < 3:
        return _plain_hand(anatomy, joint)
    knuckles = sorted(below, key=anatomy.length)[1:]
    middle = anatomy.positions[knuckles].mean(axis=0)
    spread = anatomy.positions[knuckles] - middle
    aside = np.linalg.svd(spread)[2][0]
    half = float(np.abs(spread @ aside).max())
    steps: list[Slab | Cut] = [
        Slab(joint, wrist, middle, 0.0155 * height, thick, 0.0, aside, 0.3 * half, half)
    ]
    for finger in anatomy.below(joint):
        ends = [anatomy.positions[child] for child in anatomy.children[finger]]
        tip = anatomy.tip_of(finger)
        for end in [*ends, *([tip] if tip is not None else [])]:
            steps.append(
                Slab(
                    finger, anatomy.positions[finger], end, 0.0085 * height, 0.0072 * height,
                    0.007 * height, anatomy.across,
                )
            )  # fmt: skip
    thumb = min(below, key=anatomy.length)
    start = wrist + 0.3 * (middle - wrist)
    steps.append(
        Slab(joint, start, anatomy.positions[thumb], thick, 0.009 * height, 0.01 * height, anatomy.across)
    )
    return steps


def _plain_hand(anatomy: Anatomy, joint: int) -> list[Slab | Cut]:
    """A mitten where the skeleton has no fingers, along the bone that ends there."""
    height, wrist = anatomy.height, anatomy.positions[joint]
    parent = anatomy.skeleton.parents[joint]
    ends = [anatomy.positions[child] for child in anatomy.below(joint)]
    ends += [tip for end, tip in anatomy.tips if end in (joint, *anatomy.below(joint))]
    far = max(ends, key=lambda end: float(np.linalg.norm(end - wrist)), default=None)
    if far is None or float(np.linalg.norm(far - wrist)) < 0.03 * height:
        bone = wrist - anatomy.positions[parent]
        far = wrist + 0.085 * height * bone / max(float(np.linalg.norm(bone)), 1e-9)
    direction = (far - wrist) / np.linalg.norm(far - wrist)
    aside = anatomy.forward - direction * float(anatomy.forward @ direction)
    aside = aside / max(float(np.linalg.norm(aside)), 1e-9)
    knuckles = wrist + 0.45 * (far - wrist)
    return [
        Slab(joint, wrist, knuckles, 0.0155 * height, 0.012 * height, 0.0, aside, 0.003 * height, 0.016 * height),
        Slab(joint, knuckles, far, 0.012 * height, 0.007 * height, 0.004 * height, aside, 0.016 * height,
             0.008 * height),
    ]  # fmt: skip


def foot(anatomy: Anatomy, joint: int) -> list[Slab | Cut]:
    """Heel, instep and toes over a flat sole."""
    height, ankle = anatomy.height, anatomy.positions[joint]
    below = anatomy.below(joint)
    ends = [anatomy.positions[child] for child in below]
    ends += [tip for end, tip in anatomy.tips if end in (joint, *below)]
    toes = max(ends, key=lambda end: float(np.linalg.norm(end - ankle)), default=None)
    if toes is None or float(np.linalg.norm((toes - ankle) * [1, 0, 1])) < 0.02 * height:
        toes = ankle + 0.08 * height * anatomy.forward - 0.026 * height * _UP
    ahead = (toes - ankle) * np.array([1.0, 0.0, 1.0])
    ahead = ahead / np.linalg.norm(ahead)
    aside = np.cross(_UP, ahead)
    sole = min(float(toes[1]), float(ankle[1]) - 0.020 * height) - 0.008 * height
    ball = ankle + 0.72 * (toes - ankle)
    ball[1] = sole + 0.014 * height
    tip = toes + 0.012 * height * ahead
    tip[1] = sole + 0.010 * height
    heel = ankle - 0.022 * height * ahead
    heel[1] = sole + 0.020 * height
    mover = next((child for child in anatomy.children[joint] if anatomy.children[child] or
                  anatomy.tip_of(child) is not None), joint)  # fmt: skip
    middle = 0.5 * (anatomy.positions[joint] + ball)
    return [
        Slab(joint, ankle, heel, 0.019 * height, 0.021 * height, 0.0, aside),
        Slab(joint, ankle + 0.004 * height * ahead, ball, 0.020 * height, 0.015 * height, 0.010 * height, aside,
             0.0, 0.014 * height),
        Slab(joint, heel, middle, 0.019 * height, 0.018 * height, 0.010 * height, aside, 0.002 * height,
             0.006 * height),
        Slab(mover, ball, tip, 0.014 * height, 0.009 * height, 0.004 * height, aside, 0.014 * height,
             0.011 * height),
        Cut(np.array([ankle[0], sole, ankle[2]]), -_UP, 0.14 * height, 0.006 * height),
    ]  # fmt: skip


def _head_axis(anatomy: Anatomy, joint: int) -> tuple[Array, float]:
    """Unit vector from the head joint to the crown, and how far that is, metres."""
    place = anatomy.positions[joint]
    tip = anatomy.tip_of(joint)
    if tip is not None and float(np.linalg.norm(tip - place)) > 0.04 * anatomy.height:
        return (tip - place) / np.linalg.norm(tip - place), float(np.linalg.norm(tip - place))
    parent = anatomy.skeleton.parents[joint]
    neck = place - anatomy.positions[parent] if parent >= 0 else _UP
    if float(neck @ _UP) > 0.5 * float(np.linalg.norm(neck)):
        neck = _UP
    return neck / max(float(np.linalg.norm(neck)), 1e-9), 0.105 * anatomy.height
