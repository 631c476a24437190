"""Where a label has room: beside its lamp, on no other label, symbol or root of a beam."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appliance.pose.quaternion import Array

_AWAY_PX = (16.0, 24.0, 34.0, 46.0, 60.0)  # a label farther away belongs to nothing
_STRAIGHT = np.array([(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)])
WAYS = np.vstack([_STRAIGHT, np.array([(1, 1), (-1, 1), (1, -1), (-1, -1)]) * np.sqrt(0.5)])
_SLANTED = 0.5  # straight above, below or beside looks tidier
_APART_PX = 3.0


class Rectangle(NamedTuple):
    left: float
    bottom: float
    right: float
    top: float

    @property
    def middle(self) -> tuple[float, float]:
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2

    def meets(self, other: Rectangle) -> bool:
        return (
            self.left < other.right
            and other.left < self.right
            and self.bottom < other.top
            and other.bottom < self.top
        )

    def holds(self, other: Rectangle) -> bool:
        return (
            self.left <= other.left
            and other.right <= self.right
            and self.bottom <= other.bottom
            and other.top <= self.top
        )


def free_place(
    at: Array, size: tuple[float, float], towards: Array, taken: Sequence[Rectangle], walls: Rectangle
) -> Rectangle | None:
    """The nearest free place for a label of a size (width, height) beside a point, in pixels; None: none.

    towards: the way that it goes first of several that are as near, (2,).
    """
    first = WAYS[np.argsort(-(WAYS @ towards) + _SLANTED * WAYS.all(axis=1), kind="stable")]
    for away in _AWAY_PX:
        for way in first:
            reach = away + np.abs(way) @ size / 2  # from the point to the label's middle
            x, y = at + way * reach
            place = Rectangle(x - size[0] / 2, y - size[1] / 2, x + size[0] / 2, y + size[1] / 2)
            wider = Rectangle(
                place.left - _APART_PX,
                place.bottom - _APART_PX,
                place.right + _APART_PX,
                place.top + _APART_PX,
            )
            if walls.holds(place) and not any(wider.meets(one) for one in taken):
                return place
    return None
