"""A picture of the rig, from above and from the audience: fixtures, dancer, where the heads point."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from appliance.lights.patch import Patch
from appliance.pictures.filmstrip import MissingPicturesError
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.show.lights import FixtureConfig

DARK, FLOOR, GRID = "#101015", "#1b1c24", "#2a2c37"
INK, FAINT, BONE = "#efe6d8", "#9a948c", "#e8dcc6"
BEAM, LAMP, AUDIENCE = "#f2c14e", "#f45d48", "#6f7a94"
MARGIN_M = 1.0
LONGEST_BEAM_M = 12.0
VIEWS = (("From above", 0, 2), ("From the audience", 0, 1))  # title, axis to the right, axis upwards


def draw_plan(
    path: Path, patch: Patch, skeleton: Skeleton, dancer: Array, trail: Array, title: str, scene: str
) -> Path:
    """Draw the rig into a PNG and return its path.

    dancer: (J, 3) metres, the joints in the moment that the heads' angles belong to; trail: (N, 3) metres,
    the root's way through the phrase; scene: a line about that moment. Raises MissingPicturesError.
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
        _View(axes, view, patch, dancer).draw(skeleton, dancer, trail)
    figure.text(0.05, 0.94, title, color=INK, fontsize=20, va="center")
    figure.text(0.05, 0.89, scene, color=FAINT, fontsize=11.5, va="center")
    path.parent.mkdir(parents=True, exist_ok=True)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(path)
    return path


class _View:
    """One projection of the stage: two of its axes, in metres."""

    def __init__(self, axes: Any, view: tuple[str, int, int], patch: Patch, dancer: Array) -> None:
        self._axes, self._patch = axes, patch
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
        self._beams()
        for fixture in self._patch.fixtures:
            self._fixture(fixture)

    def _frame(self, dancer: Array) -> None:
        """Limits around everything, a 1 m grid, and the audience."""
        axes = self._axes
        places = np.array([fixture.place for fixture in self._patch.fixtures])
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

    def _beams(self) -> None:
        """Each head's beam down to the floor, at most LONGEST_BEAM_M."""
        heads = self._patch.heads
        for place, beam in zip(heads.places, heads.beams(), strict=True):
            end = place + beam * _length(place, beam)
            for width, alpha in ((9, 0.10), (4, 0.18), (1.4, 0.9)):
                self._axes.plot(
                    *self._flat(np.array([place, end])).T,
                    color=BEAM,
                    lw=width,
                    alpha=alpha,
                    zorder=4,
                    solid_capstyle="round",
                )
            if self._is_plan and end[1] < 0.01:
                self._axes.plot(*self._flat(end), "o", color=BEAM, ms=7, alpha=0.5, zorder=4)

    def _fixture(self, fixture: FixtureConfig) -> None:
        moves = any(head.fixture is fixture for head in self._patch.heads.heads)
        x, y = self._flat(np.array(fixture.place))
        marker = ("v" if fixture.pose == "hanging" else "^") if moves else "s"
        self._axes.plot(x, y, marker, color=LAMP, ms=11 if moves else 8, mec=DARK, mew=1, zorder=7)
        self._axes.annotate(
            fixture.name,
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
