"""Corner-pin: the homography that lays the picture onto four points of the wall; which points are valid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
Corners = tuple[Point, Point, Point, Point]

WHOLE: Corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
FARTHEST = 0.5  # how far beyond the display's edge a corner may lie, as a share of its size
_LEAST_TURN = 1e-3  # twice the area of the triangle at a corner; below it the picture is a line


def homography(corners: Corners) -> NDArray[np.float64]:
    """The (3, 3) projective map from the picture's unit square onto four points, in their order.

    (0, 0), (1, 0), (1, 1), (0, 1) land on corners 1 to 4 exactly; lines stay lines. Closed form of Heckbert,
    Fundamentals of Texture Mapping and Image Warping (1989), section 2.2.3.
    """
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = corners
    ax, ay = x1 - x2, y1 - y2
    bx, by = x3 - x2, y3 - y2
    sx, sy = x0 - x1 + x2 - x3, y0 - y1 + y2 - y3
    area = ax * by - ay * bx
    g = (sx * by - sy * bx) / area
    h = (ax * sy - ay * sx) / area
    return np.array(
        [[x1 - x0 + g * x1, x3 - x0 + h * x3, x0], [y1 - y0 + g * y1, y3 - y0 + h * y3, y0], [g, h, 1.0]]
    )


def complaint(corners: Corners) -> str:
    """Why no picture fits these corners, and what to do; empty when one does."""
    if not np.isfinite(corners).all():
        return "A corner is not a number. The picture stays as it is. Give two numbers from 0 to 1."
    if not all(-FARTHEST <= part <= 1.0 + FARTHEST for point in corners for part in point):
        return (
            "A corner lies too far outside of what the projector lights. The picture stays as it is. "
            f"Keep it between {-FARTHEST:g} and {1 + FARTHEST:g} of the width and height."
        )
    turns = [_turn(corners[k - 1], corners[k], corners[(k + 1) % 4]) for k in range(4)]
    if all(turn > _LEAST_TURN for turn in turns):
        return ""
    if all(turn < -_LEAST_TURN for turn in turns):
        return (
            "These corners show the picture from behind. The picture stays as it is. "
            "Go clockwise from the top left; for rear projection use the mirror."
        )
    return (
        "These corners fold the picture: it has a dent, two edges cross, or a side is gone. "
        "The picture stays as it is. Keep each corner outside of the triangle of the other three."
    )


def _turn(before: Point, here: Point, after: Point) -> float:
    """Above 0 where the outline turns clockwise (y points down)."""
    return (here[0] - before[0]) * (after[1] - here[1]) - (here[1] - before[1]) * (after[0] - here[0])
