"""Mesh warp: a grid of points that pull the picture, for walls that are not flat."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from appliance.projector.corners import Corners, Point, homography

POINTS = 5  # across and down; those in the corners are the corner-pin's
FINE = 33  # points across and down of the grid that is drawn with
FARTHEST = 0.25  # share of the display, from the point between the corners
NOT_WARPED: tuple[Point, ...] = ()
_CORNERS = (0, POINTS - 1, POINTS * (POINTS - 1), POINTS * POINTS - 1)

Warp = tuple[Point, ...]  # shares of the display, row by row from the top left; () for none


def moved(warp: Warp, point: int, by: Point) -> Warp:
    """With one point, 0 to 24, moved by this much. Raises ValueError for a corner, or none of them."""
    if not 0 <= point < POINTS**2 or point in _CORNERS:
        raise ValueError("The points of the mesh are 1 to 25, without the corners 1, 5, 21 and 25.")
    found = list(warp or ((0.0, 0.0),) * POINTS**2)
    x, y = found[point]
    found[point] = x + by[0], y + by[1]
    return tuple(found)


def complaint(warp: Warp, corners: Corners) -> str:
    """Why the picture cannot be warped like this, and what to do; empty when it can."""
    if not warp:
        return ""
    if len(warp) != POINTS**2 or not np.isfinite(warp).all():
        return "This is no mesh of 25 points. The picture stays as it is."
    if np.abs(warp).max() > FARTHEST:
        return "A point of the mesh is too far off. The picture stays as it is. Move the corners first."
    places = on_display(warp, corners)
    right, down = np.diff(places, axis=1)[:-1], np.diff(places, axis=0)[:, :-1]
    turns = right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0]
    if turns.min() <= 0.0:
        return (
            "The mesh folds the picture there. The picture stays as it is. Move the points around it along."
        )
    return ""


def on_display(warp: Warp, corners: Corners) -> NDArray[np.float64]:
    """Where the points of the fine grid are, (FINE, FINE, 2) in shares of the display, y down."""
    share = np.linspace(0.0, 1.0, FINE)
    x, y = np.meshgrid(share, share)
    mapped = np.stack([x, y, np.ones_like(x)], axis=-1) @ homography(corners).T
    return np.asarray(mapped[..., :2] / mapped[..., 2:] + fine(warp))


def fine(warp: Warp) -> NDArray[np.float64]:
    """The offsets between the points too, (FINE, FINE, 2): through each of them, without a kink at any."""
    if not warp:
        return np.zeros((FINE, FINE, 2))
    between = _between()
    grid = np.asarray(warp, np.float64).reshape(POINTS, POINTS, 2)
    return np.asarray(np.einsum("ij,kl,jlc->ikc", between, between, grid))


@functools.cache
def _between() -> NDArray[np.float64]:
    """(FINE, POINTS): the natural cubic spline through equally spaced points, as weights of its points.

    Its second derivatives m solve m[k-1] + 4 m[k] + m[k+1] = 6 (y[k-1] - 2 y[k] + y[k+1]), zero at the ends.
    """
    inner = POINTS - 2
    second = np.zeros((POINTS, POINTS))
    system = 4.0 * np.eye(inner) + np.eye(inner, k=1) + np.eye(inner, k=-1)
    differences = np.eye(inner, POINTS) - 2.0 * np.eye(inner, POINTS, k=1) + np.eye(inner, POINTS, k=2)
    second[1:-1] = np.linalg.solve(system, 6.0 * differences)
    at = np.linspace(0.0, POINTS - 1.0, FINE)
    left = np.minimum(at.astype(int), POINTS - 2)
    t = (at - left)[:, None]
    y = np.eye(POINTS)
    curve = ((1 - t) ** 3 - (1 - t)) / 6 * second[left] + (t**3 - t) / 6 * second[left + 1]
    return np.asarray((1 - t) * y[left] + t * y[left + 1] + curve)
