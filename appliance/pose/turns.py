"""Turns of single bones, in plain Python: quicker than arrays for one quaternion at a time."""

from __future__ import annotations

import math

Quaternion = tuple[float, float, float, float]  # w, x, y, z
Vector = tuple[float, float, float]
UNTURNED: Quaternion = (1.0, 0.0, 0.0, 0.0)
_SHORTEST = 1e-9
_OPPOSITE = -1.0 + 1e-9  # cosine of directions that lie opposite each other


def multiplied(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    w, x, y, z = a
    t, i, j, k = b
    return (
        w * t - x * i - y * j - z * k,
        w * i + x * t + y * k - z * j,
        w * j - x * k + y * t + z * i,
        w * k + x * j - y * i + z * t,
    )


def inverse(turn: Quaternion) -> Quaternion:
    """The turn back; of unit length."""
    return turn[0], -turn[1], -turn[2], -turn[3]


def rotated(turn: Quaternion, vector: Vector) -> Vector:
    """A vector turned."""
    w, x, y, z = turn
    a, b, c = vector
    i, j, k = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i


def halfway(a: Quaternion, b: Quaternion) -> Quaternion:
    """In the middle of two turns, along the shorter way."""
    sign = 1.0 if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] >= 0.0 else -1.0
    w, x, y, z = a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2], a[3] + sign * b[3]
    length = math.sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def about(axis: Vector, radians: float) -> Quaternion:
    """A turn about a unit axis."""
    sine = math.sin(0.5 * radians)
    return math.cos(0.5 * radians), sine * axis[0], sine * axis[1], sine * axis[2]


def axis_angle(turn: Quaternion) -> tuple[Vector, float]:
    """Unit axis and angle, 0 to pi radians, the short way; the axis of no turn is x."""
    w, *axis = turn
    sine = math.hypot(*axis)
    if sine < _SHORTEST:
        return (1.0, 0.0, 0.0), 0.0
    x, y, z = (math.copysign(part, part * w) / sine for part in axis)
    return (x, y, z), 2.0 * math.atan2(sine, abs(w))


def swing(start: Vector, end: Vector) -> Quaternion:
    """The shortest turn from one unit vector to another."""
    cosine = dot(start, end)
    if cosine < _OPPOSITE:
        least = min(range(3), key=lambda axis: abs(start[axis]))
        across = unit(cross(start, (float(least == 0), float(least == 1), float(least == 2))))
        return (0.0, *across) if across else UNTURNED
    x, y, z = cross(start, end)
    w = 1.0 + cosine
    length = math.sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def twist(axis: Vector, start: Vector, end: Vector) -> float | None:
    """Radians about a unit axis from one vector to another, seen along it; None: one is parallel to it."""
    a, b = unit(_beside(axis, start)), unit(_beside(axis, end))
    return None if a is None or b is None else math.atan2(dot(axis, cross(a, b)), dot(a, b))


def unit(vector: Vector) -> Vector | None:
    """Its direction; None: it has no length."""
    length = math.sqrt(dot(vector, vector))
    if not _SHORTEST < length < math.inf:
        return None
    return vector[0] / length, vector[1] / length, vector[2] / length


def minus(a: Vector, b: Vector) -> Vector:
    """From b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def middle(a: Vector, b: Vector) -> Vector:
    """The middle of two places."""
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


def dot(a: Vector, b: Vector) -> float:
    """Their scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Their vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _beside(axis: Vector, vector: Vector) -> Vector:
    along = dot(axis, vector)
    return vector[0] - along * axis[0], vector[1] - along * axis[1], vector[2] - along * axis[2]
