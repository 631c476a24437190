"""How an emulated hand moves: orientation as a function of time. The same seed gives the same dance."""

from __future__ import annotations

import random
from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import atan2, cos, pi, radians, sin, sqrt

Quaternion = tuple[float, float, float, float]  # w, x, y, z, unit
Motion = Callable[[float], Quaternion]  # seconds since the start -> orientation

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
LARGEST_STEP_DEGREES = (
    40.0  # the box believes 2000 degrees a second and 3 of slack: 43 degrees from one to the next
)


def still(orientation: Quaternion = IDENTITY) -> Motion:
    """Standing still."""
    return lambda t_s: orientation


def turning(axis: Sequence[float] = (0.0, 1.0, 0.0), seconds_per_turn: float = 5.0) -> Motion:
    """Round one axis at a constant rate; negative seconds turn the other way. Raises ValueError at 0."""
    if not seconds_per_turn:
        raise ValueError("a turn in 0 seconds is none; to stand still, say still")
    about(axis, 0.0)
    return lambda t_s: about(axis, 2 * pi * t_s / seconds_per_turn)


def step(axis: Sequence[float] = (0.0, 1.0, 0.0), degrees: float = 30.0, every_s: float = 1.0) -> Motion:
    """Jumps between two orientations, `degrees` apart, every `every_s`: to measure the response latency with.

    Raises ValueError above 40 degrees: the box takes faster jumps for a broken sensor, and waits before it
    follows.
    """
    if not 0 < abs(degrees) <= LARGEST_STEP_DEGREES:
        raise ValueError(
            f"a step of {degrees:g} degrees is faster than any hand, and the box holds back what is. "
            f"Give at most {LARGEST_STEP_DEGREES:g}"
        )
    ends = about(axis, 0.0), about(axis, radians(degrees))
    return lambda t_s: ends[int(t_s / every_s + 1e-9) % 2]


def dance(seed: int = 0) -> Motion:
    """A hand that dances: smooth, never the same, up to about 400 degrees a second."""
    source = random.Random(f"dance {seed}")
    waves = [
        [
            (
                radians(source.uniform(0.5, 1.0) * amplitude),
                2 * pi * source.uniform(0.7, 1.3) * hz,
                source.uniform(0, 2 * pi),
            )
            for amplitude, hz in ((60.0, 0.13), (35.0, 0.41), (15.0, 0.97), (4.0, 2.1))
        ]
        for _ in range(3)
    ]

    def orientation(t_s: float) -> Quaternion:
        x, y, z = (sum(a * sin(rate * t_s + phase) for a, rate, phase in axis) for axis in waves)
        return multiply(multiply(about((0, 1, 0), y), about((1, 0, 0), x)), about((0, 0, 1), z))

    return orientation


def trace(times_s: Sequence[float], orientations: Sequence[Quaternion]) -> Motion:
    """A recording, forwards and backwards in turn so that it never jumps; straight between its samples.

    `times_s` rise from any start. Raises ValueError with fewer than two samples or times that do not rise.
    """
    if len(times_s) != len(orientations) or len(times_s) < 2:
        raise ValueError("a trace needs at least two samples")
    if any(b <= a for a, b in pairwise(times_s)):
        raise ValueError("the times of a trace must rise from sample to sample")
    start, length = times_s[0], times_s[-1] - times_s[0]

    def orientation(t_s: float) -> Quaternion:
        at = t_s % (2 * length)
        at = start + (at if at <= length else 2 * length - at)
        right = min(max(bisect_right(times_s, at), 1), len(times_s) - 1)
        share = (at - times_s[right - 1]) / (times_s[right] - times_s[right - 1])
        return _between(orientations[right - 1], orientations[right], share)

    return orientation


def about(axis: Sequence[float], angle: float) -> Quaternion:
    """The rotation by `angle` radians about `axis`, of any length but zero."""
    x, y, z = axis
    length = sqrt(x * x + y * y + z * z)
    if not length:
        raise ValueError("an axis of length zero points nowhere; give for instance 0,1,0")
    scale = sin(angle / 2) / length
    return cos(angle / 2), x * scale, y * scale, z * scale


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(rotation: Quaternion) -> Quaternion:
    """The rotation back."""
    w, x, y, z = rotation
    return w, -x, -y, -z


def part_of(rotation: Quaternion, share: float) -> Quaternion:
    """That share of the way from the identity to `rotation`, the short way round."""
    w, x, y, z = rotation if rotation[0] >= 0 else tuple(-part for part in rotation)
    sine = sqrt(x * x + y * y + z * z)
    return about((x, y, z), 2 * atan2(sine, w) * share) if sine else IDENTITY


def _between(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    sign = 1.0 if sum(p * q for p, q in zip(a, b, strict=True)) >= 0 else -1.0
    w, x, y, z = (p + share * (sign * q - p) for p, q in zip(a, b, strict=True))
    norm = sqrt(w * w + x * x + y * y + z * z)
    return w / norm, x / norm, y / norm, z / norm
