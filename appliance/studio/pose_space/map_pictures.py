"""The map's pictures: methods side by side, the map with figures and paths, two paths' distance over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D

from appliance.pose.quaternion import Array
from appliance.studio.evaluation.pictures import BACKDROP, INK, new_figure, panels, save
from appliance.studio.pose_space.projections import Projection

DIM = "#6b6660"
WIDTH = 12.0  # size of the map, inches
COLOURS = ("#e2583e", "#4fb3bf", "#e8b04b", "#9b7fd1", "#7fbf6a", "#d97fa8")


def draw_projections(path: Path, names: Sequence[str], found: Sequence[Projection]) -> None:
    """A panel for each method, a colour for each recording."""
    figure = new_figure(4.2 * len(found), 4.2)
    side_by_side = panels(figure, 1, len(found))
    for axes, projection in zip(side_by_side, found, strict=True):
        for number, points in enumerate(projection.points):
            axes.plot(*points[:, :2].T, color=COLOURS[number % len(COLOURS)], linewidth=0.6, alpha=0.9)
        step, longest = projection.continuity
        axes.set_title(f"{projection.name}\nstep {step:.1f} %, longest x{longest:.0f}", color=INK, fontsize=9)
        axes.set_xticks([])
        axes.set_yticks([])
    _name(side_by_side[0], names)
    save(figure, path)


def draw_map(
    path: Path,
    known: Array,
    paths: Mapping[str, Array],
    figures: Sequence[tuple[Array, Array, Sequence[tuple[int, int]]]],
    nobody: float,
    marks: Array | None = None,
) -> tuple[float, float, float, float]:
    """All recorded poses as a cloud, figures that are usual at a place, recordings as lines.

    Faint figures: nobody has been there: farther than `nobody` of the map's spread from all recorded poses.
    marks (N, 2 or more): numbered places.
    Returns the frame: left, right, bottom, top in the map's units; the picture fills it.
    """
    places = np.array([place for place, _, _ in figures])
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.5 * float(np.max(high - low)) / max(1.0, np.sqrt(len(figures)))
    left, bottom = (low - margin).tolist()
    right, top = (high + margin).tolist()
    figure = new_figure(WIDTH, WIDTH * (top - bottom) / (right - left))
    figure.set_layout_engine("none")  # the axes fill the picture
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.scatter(*known[:: max(1, len(known) // 8000), :2].T, s=2.0, color=DIM, linewidths=0)
    spread = float(known[:, :2].std(axis=0).max())
    size = 0.8 * _spacing(places)
    segments, colours = [], []
    for place, joints, bones in figures:
        away = float(np.linalg.norm(known[:, :2] - place, axis=1).min())
        shade = to_rgba(INK, 0.95) if away <= nobody * spread else to_rgba(DIM, 0.8)
        scale = size / max(float(np.ptp(joints[:, 1])), 1.6)
        segments += [place + scale * joints[[joint, parent]][:, :2] for joint, parent in bones]
        colours += [shade] * len(bones)
    axes.add_collection(
        LineCollection(segments, colors=colours, linewidths=1.3, capstyle="round", zorder=3), autolim=False
    )
    for number, points in enumerate(paths.values()):
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(*points[:, :2].T, color=colour, linewidth=0.9, alpha=0.6, zorder=2)
    for number, place in enumerate(() if marks is None else marks[:, :2], 1):
        where = np.clip(place, (left, bottom), (right, top))
        axes.plot(*where, "o", markersize=20, color=BACKDROP, markeredgecolor=INK, zorder=5)
        axes.text(*where, str(number), color=INK, fontsize=11, ha="center", va="center", zorder=6)
    _name(axes, list(paths))
    save(figure, path)
    return left, right, bottom, top


def draw_distance(path: Path, apart: Array, one: str, other: str, fps: float) -> None:
    """How far apart two recordings are on the map, over time."""
    figure = new_figure(10.0, 3.0)
    (axes,) = panels(figure, 1, 1)
    axes.plot(np.arange(len(apart)) / fps, apart, color=COLOURS[0], linewidth=1.0)
    axes.set_title(f"{one} and {other}: distance on the map over time (s)", color=INK, fontsize=10)
    axes.set_ylim(bottom=0)
    save(figure, path)


def _spacing(places: Array) -> float:
    """Distance between neighbours of a grid."""
    columns = np.unique(np.round(places[:, 0], 6))
    return float(np.diff(columns).min()) if len(columns) > 1 else 1.0


def _name(axes: Any, names: Sequence[str]) -> None:
    """The recordings' names in one opaque box, so that no figure shows through a word."""
    lines = [
        Line2D([], [], color=COLOURS[number % len(COLOURS)], label=name)
        for number, name in enumerate(names[:12])
    ]
    colours = {"facecolor": BACKDROP, "edgecolor": DIM, "framealpha": 1.0, "labelcolor": "linecolor"}
    axes.legend(handles=lines, loc="upper left", fontsize=9, **colours).set_zorder(4)
