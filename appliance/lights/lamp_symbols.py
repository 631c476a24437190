"""Symbols of lamps in a plan: a shape for each kind, turned along its beam, the lens in its colour."""

from __future__ import annotations

from typing import Any

import numpy as np

from appliance.lights.beams import LAMP, SPOT, WASH, Beam
from appliance.pose.quaternion import Array

INK, FAINT, BODY = "#f3ece0", "#a9adb6", "#1d2028"
KINDS = {SPOT: (7.0, 11.0), WASH: (9.5, 7.0), LAMP: (6.5, 6.5)}  # half width and half length, pixels
DARK_LEVEL = 0.02


def draw_symbol(axes: Any, at: Array, way: Array, beam: Beam, unit: float) -> None:
    """A lamp at a place, turned the way its beam goes (both in the view); unit: a pixel, in its units."""
    from matplotlib.patches import Polygon, Rectangle

    half_width, half_length = (unit * size for size in KINDS[beam.kind])
    lens = tuple(beam.colour) if beam.level >= DARK_LEVEL else BODY
    if beam.kind != LAMP:  # the base that it turns in
        side = 2.4 * half_width
        axes.add_patch(
            Rectangle(
                (at[0] - side / 2, at[1] - side / 2),
                side,
                side,
                facecolor=BODY,
                edgecolor=FAINT,
                lw=1.0,
                zorder=6,
            )
        )
    angles = np.linspace(0.0, 2.0 * np.pi, 41)
    long = float(np.linalg.norm(way))
    ahead = way / long if long > 1e-6 else np.array([0.0, 1.0])
    aside = np.array([-ahead[1], ahead[0]])
    disc = half_width * (
        np.sin(angles)[:, None] * aside + np.sqrt(max(1 - long**2, 0.0)) * np.cos(angles)[:, None] * ahead
    )
    tail = disc if beam.kind == WASH else 0.7 * disc
    body = _hull(np.vstack([at + half_length * way + disc, at - half_length * way + tail]))
    axes.add_patch(Polygon(body, facecolor=BODY, edgecolor=INK, lw=1.2, joinstyle="round", zorder=7))
    glass = at + half_length * way + 0.72 * disc
    axes.add_patch(Polygon(glass, facecolor=lens, edgecolor=lens, lw=2.0, joinstyle="round", zorder=8))


def _hull(points: Array) -> Array:
    """The convex outline (H, 2) of points (P, 2), counter-clockwise (Andrew's monotone chain)."""
    outline: list[Array] = []
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    for line in (ordered, ordered[::-1]):
        first = len(outline)
        for point in line:
            while len(outline) > first + 1 and _turn(outline[-2], outline[-1], point) <= 0:
                outline.pop()
            outline.append(point)
        outline.pop()
    return np.array(outline)


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
