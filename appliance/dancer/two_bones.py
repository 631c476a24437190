"""Two-bone inverse kinematics in plain floats: moves the end of a leg, and the knee follows.

One leg costs 15 us; numpy would take ten times as long for vectors of three.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from appliance.pose.turns import Quaternion, Vector, cross, dot, minus

_STRETCH = 0.999  # fraction of the chain's length: a straight leg would have no direction to bend in
_BEND = 0.02  # fraction of the upper bone's length: weight of the preferred direction for a straight leg


def bend(root: Vector, middle: Vector, end: Vector, target: Vector, towards: Vector) -> tuple[Vector, Vector]:
    """Where the middle and the end of a chain of two bones come to be when its end reaches for a target.

    Positions in metres. The chain keeps its plane as far as it can; a straight one bends towards `towards`
    (any length). A target out of reach is approached along the line from the present end as far as the
    longer of the chain and its present length allows.
    """
    upper, lower = minus(middle, root), minus(end, middle)
    long, short = norm(upper), norm(lower)
    now = minus(end, root)
    wanted = _within_reach(now, minus(target, end), max(_STRETCH * (long + short), norm(now)))
    reach = norm(wanted)
    if reach < 1e-6:
        return middle, end
    along = (long * long - short * short + reach * reach) / (2 * reach)
    high = math.sqrt(max(0.0, long * long - along * along))
    bent = rotate(between(now, wanted), upper)
    pole = add(bent, scale(towards, _BEND * long / max(norm(towards), 1e-9)))
    axis = scale(wanted, 1 / reach)
    pole = minus(pole, scale(axis, dot(pole, axis)))
    pole = scale(pole, high / max(norm(pole), 1e-9))
    knee = add(add(root, scale(axis, along)), pole)
    return knee, add(root, wanted)


def _within_reach(now: Vector, step: Vector, reach: float) -> Vector:
    """now + as much of the step (at most all) as leaves the sum no longer than reach."""
    wanted = add(now, step)
    over = dot(wanted, wanted) - reach * reach
    if over <= 0.0:
        return wanted
    a, b, c = dot(step, step), dot(now, step), dot(now, now) - reach * reach
    share = (-b + math.sqrt(max(0.0, b * b - a * c))) / a
    return add(now, scale(step, min(max(share, 0.0), 1.0)))


def vector(values: Iterable[float]) -> Vector:
    """Three numbers as a vector."""
    x, y, z = values
    return x, y, z


def quaternion(values: Iterable[float]) -> Quaternion:
    """Four numbers, w first, as a quaternion."""
    w, x, y, z = values
    return w, x, y, z


def between(a: Vector, b: Vector) -> Quaternion:
    """The shortest rotation of direction a to direction b."""
    x, y, z = cross(a, b)
    w = norm(a) * norm(b) + dot(a, b)
    length = math.sqrt(w * w + x * x + y * y + z * z)
    return (w / length, x / length, y / length, z / length) if length > 1e-12 else (1.0, 0.0, 0.0, 0.0)


def rotate(q: Quaternion, v: Vector) -> Vector:
    """A vector turned by a unit quaternion."""
    w, axis = q[0], q[1:]
    twice = scale(cross(axis, v), 2.0)
    return add(add(v, scale(twice, w)), cross(axis, twice))


def norm(a: Vector) -> float:
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def scale(a: Vector, by: float) -> Vector:
    return a[0] * by, a[1] * by, a[2] * by
