"""A picture of the rig, from above and from the audience: fixtures, dancer, where the heads point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appliance.lights.beams import Beam
from appliance.pictures.filmstrip import MissingPicturesError
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

DARK, FLOOR, GRID = "#101015", "#1b1c24", "#2a2c37"
INK, FAINT, BONE = "#efe6d8", "#9a948c", "#e8dcc6"
AUDIENCE = "#6f7a94"
MARGIN_M = 1.0
LONGEST_BEAM_M = 12.0
DARK_LEVEL = 0.02
VIEWS = (("From above", 0, 2), ("From the audience", 0, 1))  # title, axis to the right, axis upwards


def draw_plan(
    path: Path,
    beams: Sequence[Beam],
    skeleton: Skeleton,
    dancer: Array,
    trail: Array,
    title: str,
    scene: str,
) -> Path:
    """Draw the rig into a PNG and return its path.

    Each beam has its colour, width and level; a dark one is dashed. dancer: (J, 3) metres, the joints in the
    moment that the beams belong to; trail: (N, 3) metres, the root's way through the phrase; scene: a line
    about that moment. Raises MissingPicturesError.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPicturesError from error
    figure = Figure(figsize=(15, 8.4), dpi=100, facecolor=DARK)
    grid = figure.add_gridspec(1, 2, left=0.05, right=0.98, top=0.84, bottom=0.08, wspace=0.12)
    for number, view in enumerate(VIEWS):
        axes = figure.add_subplot(grid[number])
        _View(axes, view, beams, dancer).draw(skeleton, dancer, trail)
    figure.text(0.05, 0.94, title, color=INK, fontsize=20, va="center")
    figure.text(0.05, 0.89, scene, color=FAINT, fontsize=11.5, va="center")
    path.parent.mkdir(parents=True, exist_ok=True)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(path)
    return path


class _View:
    """One projection of the stage: two of its axes, in metres."""

    def __init__(self, axes: Any, view: tuple[str, int, int], beams: Sequence[Beam], dancer: Array) -> None:
        self._axes, self._beams = axes, beams
        title, self._right, self._up = view
        self._is_plan = self._up == 2
        axes.set_title(title, color=INK, fontsize=13, loc="left", pad=10)
        self._frame(dancer)

    def draw(self, skeleton: Skeleton, dancer: Array, trail: Array) -> None:
        axes = self._axes
        if self._is_plan:
            axes.plot(*self._flat(trail).T, color=AUDIENCE, lw=1.0, alpha=0.7, zorder=2)
        for joint, parent in enumerate(skeleton.parents):
            if parent >= 0:
                axes.plot(
                    *self._flat(dancer[[parent, joint]]).T, color=BONE, lw=3, solid_capstyle="round", zorder=6
                )
        for beam in self._beams:
            self._beam(beam)
        for beam in {beam.fixture.name: beam for beam in self._beams}.values():
            self._fixture(beam)

    def _frame(self, dancer: Array) -> None:
        """Limits around everything, a 1 m grid, and the audience."""
        axes = self._axes
        places = np.array([beam.place for beam in self._beams])
        points = self._flat(np.concatenate([places, dancer, [[-2, 0, -2], [2, 0, 2]]]))
        low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
        if not self._is_plan:
            low[1] = -0.4
        axes.set_xlim(low[0], high[0])
        axes.set_ylim((high[1], low[1]) if self._is_plan else (low[1], high[1]))
        axes.set_aspect("equal", adjustable="box")
        axes.set_facecolor(FLOOR)
        axes.grid(color=GRID, lw=0.8, zorder=0)
        axes.tick_params(colors=FAINT, labelsize=9, length=0)
        for side in axes.spines.values():
            side.set_color(GRID)
        axes.set_xlabel("x, metres: to the dancer's left", color=FAINT, fontsize=10)
        axes.set_ylabel(
            "z, metres: to the audience" if self._is_plan else "y, metres: up", color=FAINT, fontsize=10
        )
        if self._is_plan:
            axes.text(
                0.5,
                0.015,
                "audience",
                transform=axes.transAxes,
                color=AUDIENCE,
                fontsize=12,
                ha="center",
                zorder=8,
                bbox={"facecolor": FLOOR, "edgecolor": "none", "pad": 3},
            )
        else:
            axes.axhline(0, color=AUDIENCE, lw=1.5, zorder=1)

    def _beam(self, beam: Beam) -> None:
        """A beam to the floor, at most LONGEST_BEAM_M: a cone of its colour, the brighter the denser."""
        reach = _length(beam.place, beam.direction)
        end = beam.place + beam.direction * reach
        if beam.level < DARK_LEVEL:
            if beam.is_head:
                self._axes.plot(
                    *self._flat(np.array([beam.place, end])).T, color=FAINT, lw=0.8, ls=(0, (2, 4)), zorder=4
                )
            return
        seen = float(np.sqrt(beam.level))  # the eye sees a dimmer at 25 % half as bright
        radius = reach * np.tan(np.radians(beam.degrees / 2))
        around = end + radius * _circle(beam.direction)
        around[:, 1] = np.maximum(around[:, 1], 0.0)
        rim = self._flat(around)
        start = self._flat(beam.place)
        for share in (1.0, 0.6, 0.3):  # denser towards the middle
            inner = self._flat(end) + share * (rim - self._flat(end))
            outline = _hull(np.vstack([start, inner]))
            self._axes.fill(*outline.T, color=tuple(beam.colour), alpha=0.02 + 0.15 * seen, lw=0, zorder=4)
        if self._is_plan and end[1] < 0.01:
            self._axes.fill(*rim.T, color=tuple(beam.colour), alpha=0.05 + 0.25 * seen, lw=0, zorder=3)

    def _fixture(self, beam: Beam) -> None:
        fixture = beam.fixture
        x, y = self._flat(np.array(fixture.place))
        marker = ("v" if fixture.pose == "hanging" else "^") if beam.is_head else "s"
        colour = tuple(beam.colour) if beam.level >= DARK_LEVEL else FAINT
        self._axes.plot(x, y, marker, color=colour, ms=12 if beam.is_head else 9, mec=INK, mew=1.2, zorder=7)
        self._axes.annotate(
            f"{fixture.name}  {100 * beam.level:.0f} %",
            (x, y),
            (0, 11),
            textcoords="offset points",
            color=INK,
            fontsize=9,
            ha="center",
            zorder=9,
        )

    def _flat(self, points: Array) -> Array:
        """The two coordinates that this view shows."""
        flat: Array = np.asarray(points)[..., [self._right, self._up]]
        return flat


def _length(place: Array, beam: Array) -> float:
    """Metres from a fixture along its beam to the floor."""
    if beam[1] >= -1e-3:
        return LONGEST_BEAM_M
    return min(float(place[1] / -beam[1]), LONGEST_BEAM_M)


def _circle(axis: Array) -> Array:
    """(P, 3): points around an axis, at a distance of 1."""
    aside = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside)
    angles = np.linspace(0.0, 2.0 * np.pi, 49)[:, None]
    around: Array = np.cos(angles) * aside + np.sin(angles) * np.cross(axis, aside)
    return around


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
