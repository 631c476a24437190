"""Points of a camera program in the box's axes: finds up, mirrored points, and sides that change places."""

from __future__ import annotations

import math
from collections.abc import Callable

from appliance.pose.point_fit import SIDES, Points
from appliance.pose.turns import Vector, cross, dot, middle, minus, unit

_UPRIGHT = math.cos(math.radians(30.0))  # trunk and legs in line: the figure stands, and shows what is up
_UPRIGHT_FRAMES = 10  # until the way up is settled
_HINTED, _SETTLED, _MOST = 0.2, 3.0, 10.0  # evidence that the points are mirrored, or are not; its bound
_TURNED_ROUND = math.cos(math.radians(120.0))
_LONGEST_GAP_S = 0.1  # between two frames; in a longer one a dancer may turn round
_LONGEST_MIX_UP_S = 0.3  # a figure that is turned round for longer has turned round
_Turn = Callable[[float, float, float], Vector]
_TURNS: dict[str, _Turn] = {  # by the program's axis that is up: a turn into the box's axes
    "+y": lambda x, y, z: (x, y, z),
    "-y": lambda x, y, z: (x, -y, -z),
    "+z": lambda x, y, z: (x, z, -y),
    "-z": lambda x, y, z: (x, -z, y),
}


class PointAxes:
    """Turns a stream's points into axes with +Y up, and mirrors them back where they are left-handed.

    The way up is the program's usual one until a figure has stood upright for _UPRIGHT_FRAMES frames, then
    the axis nearest to that figure's; it stays for the rest of the stream. Mirrored points show a face,
    knees and toes behind the body: that is weighed over many frames. Left and right that change places for a
    moment, as networks mix them up, are put back.
    """

    def __init__(self, is_y_down: bool) -> None:
        self._up = "-y" if is_y_down else "+y"
        self._upright: list[Vector] = []
        self._mirrored = 0.0  # evidence: above 0 mirrored
        self._is_mirrored = self._is_settled = False
        self._across: Vector | None = None
        self._across_at, self._mixed_since = -math.inf, math.inf

    def turned(self, points: Points, now: float) -> dict[str, Vector]:
        """The points in the box's axes; `points` has to have hips and shoulders (point_fit.TRUNK)."""
        self._settle_up(points)
        turn = _TURNS[self._up]
        found = {part: turn(*place) for part, place in points.items()}
        found = self._sides_put_back(found, now)
        self._weigh_mirrored(found)
        if self._is_mirrored:
            found = {part: (x, y, -z) for part, (x, y, z) in found.items()}
        return found

    def _settle_up(self, points: Points) -> None:
        if len(self._upright) >= _UPRIGHT_FRAMES or not _has(points, "knee"):
            return
        hips, shoulders, knees = (_middle(points, part) for part in ("hip", "shoulder", "knee"))
        trunk, legs = unit(minus(shoulders, hips)), unit(minus(hips, knees))
        if trunk is None or legs is None or dot(trunk, legs) < _UPRIGHT:
            return
        self._upright.append(trunk)
        if len(self._upright) == _UPRIGHT_FRAMES:
            _, y, z = (sum(axis) for axis in zip(*self._upright, strict=True))
            self._up = f"{'+' if max((y, z), key=abs) > 0.0 else '-'}{'y' if abs(y) >= abs(z) else 'z'}"
            self._across = None

    def _sides_put_back(self, points: dict[str, Vector], now: float) -> dict[str, Vector]:
        across = unit(_across(points))
        if across is None:
            return points
        before, gap_s = self._across, now - self._across_at
        self._across_at = now
        if before is not None and gap_s < _LONGEST_GAP_S and dot(across, before) < _TURNED_ROUND:
            self._mixed_since = min(self._mixed_since, now)
            if now - self._mixed_since < _LONGEST_MIX_UP_S:
                self._across = -across[0], -across[1], -across[2]
                return {_other_side(part): place for part, place in points.items()}
        self._mixed_since = math.inf
        self._across = across
        return points

    def _weigh_mirrored(self, points: Points) -> None:
        """By what a body has in front: the nose before the ears, toes before ankles, bent knees."""
        front = unit(cross(_across(points), minus(_middle(points, "shoulder"), _middle(points, "hip"))))
        if front is None:
            return
        hints: list[Vector] = []
        if "nose" in points and _has(points, "ear"):
            hints.append(minus(points["nose"], _middle(points, "ear")))
        for side in SIDES:
            hip, knee, ankle, toe = (points.get(f"{side} {part}") for part in ("hip", "knee", "ankle", "toe"))
            if toe is not None and ankle is not None:
                hints.append(minus(toe, ankle))
            if hip is not None and knee is not None and ankle is not None:
                hints.append(minus(knee, middle(hip, ankle)))
        size = math.dist(_middle(points, "hip"), _middle(points, "shoulder")) or 1.0
        behind = -sum(dot(front, hint) for hint in hints) / size
        self._mirrored = max(-_MOST, min(_MOST, self._mirrored + behind))
        if abs(self._mirrored) > (_SETTLED if self._is_settled else _HINTED):
            self._is_mirrored = self._mirrored > 0.0
            self._is_settled |= abs(self._mirrored) > _SETTLED


def _other_side(part: str) -> str:
    side, _, rest = part.partition(" ")
    return f"{'right' if side == 'left' else 'left'} {rest}" if rest else part


def _has(points: Points, part: str) -> bool:
    return all(f"{side} {part}" in points for side in SIDES)


def _middle(points: Points, part: str) -> Vector:
    return middle(points[f"left {part}"], points[f"right {part}"])


def _across(points: Points) -> Vector:
    """From the right to the left, hips and shoulders together."""
    (a, b, c), (i, j, k) = (
        minus(points[f"left {part}"], points[f"right {part}"]) for part in ("hip", "shoulder")
    )
    return a + i, b + j, c + k
