"""Filmstrip: a picture of a dance, instant beside instant, with the held joints in colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from appliance.pose.body import Body, Cones
from appliance.pose.figure import Frame, floor_shadow, render
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

COLUMN_PX, TILE_PX = 176, 320  # figures stand closer than their arms reach: tiles overlap
MARGIN_PX, HEADER_PX, FOOTER_PX = 56, 104, 44
HEIGHT_PX = 300  # of the figure in its rest pose
AZIMUTH, ELEVATION = np.radians(32), np.radians(11)
TRAIL_S = 0.6
SHADOW = 0.85
IVORY, VERMILION = np.array([0.93, 0.87, 0.78]), np.array([0.96, 0.27, 0.13])
SLATE = np.array([0.62, 0.70, 0.80])
BACKDROP, HORIZON, BOARDS = (np.array(c) / 255 for c in ([15, 16, 21], [37, 38, 47], [104, 88, 78]))
INK, FAINT = "#efe6d8", "#9a948c"


class MissingPicturesError(RuntimeError):
    """The library that draws pictures is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "Pictures need matplotlib, which is not installed here. The show itself runs without it. "
            "Install it with: pip install 'bunraku[pictures]'"
        )


@dataclass(frozen=True)
class Strip:
    """Poses drawn beside each other: local rotations (N, J, 4), roots (N, 3) metres, which of them, a label.

    held: joints in colour; stamps: words below the chosen ones, left out: their seconds.
    """

    poses: Array
    roots: Array
    chosen: np.ndarray[Any, np.dtype[np.int64]]
    label: str = ""
    colour: Array = field(default_factory=lambda: IVORY)
    held: tuple[int, ...] = ()
    stamps: tuple[str, ...] | None = None


def draw_filmstrip(
    path: Path | str,
    skeleton: Skeleton,
    poses: Array,
    roots: Array,
    fps: float,
    held: Sequence[int] = (),
    title: str = "",
    columns: int = 10,
    rows: int | None = None,
    against: Array | None = None,
    labels: tuple[str, str] = ("original", "reconstruction"),
) -> Path:
    """Draw columns x rows evenly spaced instants of a dance into a PNG and return its path.

    poses: (N, J, 4) local unit quaternions; roots: (N, 3) metres; fps: poses a second; held: joints drawn in
    colour with the way that they have just gone; against: other poses (N, J, 4) for a second row below the
    first, instant by instant (original above reconstruction). Two rows unless said otherwise.
    Raises MissingPicturesError where matplotlib is missing, ValueError where there is no pose.
    """
    if not len(poses):
        raise ValueError("a filmstrip needs at least one pose")
    strips = _rows(np.asarray(poses, float), np.asarray(roots, float), columns, rows or 2, against, labels)
    strips = [replace(strip, held=tuple(held)) for strip in strips]
    words = ", ".join(skeleton.names[joint] for joint in held)
    return draw_strips(path, skeleton, strips, fps, title, f"held: {words}" if words else "")


def draw_strips(
    path: Path | str, skeleton: Skeleton, strips: Sequence[Strip], fps: float, title: str, coloured: str = ""
) -> Path:
    """Draw strips below each other into a PNG and return its path; coloured: what the coloured joints are.

    fps: poses a second. Raises MissingPicturesError where matplotlib is missing.
    """
    matplotlib_figure, canvas = _matplotlib()
    stage = _Stage(skeleton, strips, fps)
    height, width = stage.floor.shape[:2]
    figure = matplotlib_figure(figsize=(width / 100, height / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    place = {"interpolation": "none", "aspect": "auto", "extent": (0, width, height, 0)}
    axes.imshow(np.clip(stage.floor, 0, 1), **place, zorder=0)
    _draw_trails(axes, stage.trails)
    axes.imshow(np.clip(_straight(stage.figures), 0, 1), **place, zorder=2)
    _write(axes, stage, title, coloured)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    canvas(figure).print_png(path)
    return path


def _matplotlib() -> tuple[Any, Any]:
    """matplotlib's figure and the canvas without a window, loaded when a picture is asked for."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPicturesError from error
    return Figure, FigureCanvasAgg


def _rows(
    poses: Array, roots: Array, columns: int, rows: int, against: Array | None, labels: tuple[str, str]
) -> list[Strip]:
    if against is None:
        count = min(columns * rows, len(poses))
        chosen = np.linspace(0, len(poses) - 1, count).round().astype(np.int64)
        return [Strip(poses, roots, chosen[i : i + columns]) for i in range(0, count, columns)]
    chosen = np.linspace(0, len(poses) - 1, min(columns, len(poses))).round().astype(np.int64)
    other = np.asarray(against, float)
    return [Strip(poses, roots, chosen, labels[0]), Strip(other, roots, chosen, labels[1], SLATE)]


class _Stage:
    """The picture in layers: the floor with its shadows, the trails, the figures; and where words belong."""

    def __init__(self, skeleton: Skeleton, rows: Sequence[Strip], fps: float) -> None:
        self.skeleton, self.fps = skeleton, fps
        self.body = Body(skeleton)
        self.scale = HEIGHT_PX / self.body.height
        self.times: list[tuple[float, float, str]] = []
        self.labels: list[tuple[float, str]] = []
        self.trails: list[Array] = []
        columns = max(len(row.chosen) for row in rows)
        above = self._highest(rows)
        self.floor_px = round(above * self.scale * np.cos(ELEVATION)) + 24
        self.row_px = self.floor_px + FOOTER_PX + 34
        width = 2 * MARGIN_PX + max(columns * COLUMN_PX, 3 * COLUMN_PX)
        self.floor = np.tile(BACKDROP, (HEADER_PX + self.row_px * len(rows), width, 1))
        self.figures = np.zeros((*self.floor.shape[:2], 4))
        for number, row in enumerate(rows):
            self._draw_row(row, HEADER_PX + number * self.row_px)

    def _highest(self, rows: Sequence[Strip]) -> float:
        """How far anything reaches above the floor, metres."""
        reaches = []
        for row in rows:
            positions, _ = self.skeleton.forward_kinematics(row.poses[row.chosen], row.roots[row.chosen])
            reaches.append(float(positions[..., 1].max()) - self._floor(row))
        return max(reaches) + 0.09 * self.body.height

    def _floor(self, row: Strip) -> float:
        """Height of the floor, metres: where the lowest joint of most instants is."""
        positions, _ = self.skeleton.forward_kinematics(row.poses[row.chosen], row.roots[row.chosen])
        return float(np.percentile(positions[..., 1].min(axis=-1), 20)) - 0.017 * self.body.height

    def _draw_row(self, row: Strip, top: int) -> None:
        rows = slice(top, top + self.row_px)
        self.floor[rows] = _empty_stage(self.floor.shape[1], self.row_px, self.floor_px)
        floor = self._floor(row)
        for column, index in enumerate(row.chosen):
            centre = MARGIN_PX + (column + 0.5) * COLUMN_PX
            self._figure(row, int(index), centre, floor, rows)
            self._trail(row, int(index), centre, floor, top)
            stamp = row.stamps[column] if row.stamps else f"{index / self.fps:.1f} s"
            self.times.append((centre, top + self.floor_px + FOOTER_PX, stamp))
        if row.label:
            self.labels.append((top + 12, row.label))

    def _figure(self, row: Strip, index: int, centre: float, floor: float, rows: slice) -> None:
        """Lay one figure and its shadow into their layers."""
        ground = row.roots[index] * [1, 0, 1] + [0, floor, 0]
        positions, world = self.skeleton.forward_kinematics(row.poses[index], row.roots[index])
        cones = self.body.cones(positions - ground, world)
        left = round(centre - TILE_PX / 2)
        frame = Frame(TILE_PX, self.row_px, centre - left, self.floor_px, self.scale)
        on_stage = replace(cones, start=cones.start @ _turn().T, end=cones.end @ _turn().T)
        _over(self.floor[rows], left, self._shadow(on_stage, frame))
        in_view = replace(cones, start=cones.start @ _view().T, end=cones.end @ _view().T)
        colours = np.tile(row.colour, (len(cones.joint), 1))
        colours[np.isin(cones.joint, row.held)] = VERMILION
        _over(self.figures[rows], left, render(in_view, colours, frame))

    def _shadow(self, cones: Cones, frame: Frame) -> Array:
        """Black, the floor's darkness as alpha, (height, width, 4); reckoned at half the resolution."""
        first = max(0, self.floor_px - 80) // 2
        height = frame.height // 2 - first
        half = Frame(frame.width // 2, height, frame.x0 / 2, frame.y0 / 2 - first, frame.pixels_per_metre / 2)
        dark = np.kron(floor_shadow(cones, 0.0, float(np.sin(ELEVATION)), half), np.ones((2, 2)))
        shadow = np.zeros((frame.height, frame.width, 4))
        shadow[2 * first : 2 * first + len(dark), : dark.shape[1], 3] = SHADOW * dark
        return shadow

    def _trail(self, row: Strip, index: int, centre: float, floor: float, top: int) -> None:
        """The way that the end of each held bone has gone, as pixels from old to new."""
        first = max(0, index - round(TRAIL_S * self.fps))
        here = row.roots[index] * [1, 0, 1] + [0, floor, 0]
        span = slice(first, index + 1)
        positions, _ = self.skeleton.forward_kinematics(row.poses[span], row.roots[span])
        for joint in row.held:
            child = next((c for c, p in enumerate(self.skeleton.parents) if p == joint), joint)
            seen = (positions[:, child] - here) @ _view().T * self.scale
            pixels = np.stack([centre + seen[:, 0], top + self.floor_px - seen[:, 1]], axis=-1)
            self.trails.append(pixels)


def _turn() -> Array:
    """World to stage: turned about the vertical so that we look at three quarters of a figure."""
    c, s = np.cos(AZIMUTH), np.sin(AZIMUTH)
    return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


def _view() -> Array:
    """World to view: right, up, towards the viewer, seen from a little above."""
    c, s = np.cos(ELEVATION), np.sin(ELEVATION)
    tilt: Array = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ _turn()
    return tilt


def _empty_stage(width: int, height: int, floor_px: int) -> Array:
    """A dark backdrop over wooden boards in the light of the front lamps, (height, width, 3)."""
    y = np.arange(height)[:, None, None]
    x = np.linspace(-1, 1, width)[None, :, None]
    horizon = floor_px - 26
    glow = np.clip(y / horizon, 0, 1) ** 2.2
    wall = BACKDROP + (HORIZON - BACKDROP) * glow
    nearness = np.clip((y - horizon) / (height - horizon), 0, 1)
    boards = BOARDS * (1.0 - 0.72 * nearness**0.9)
    blend = np.clip((y - horizon + 3) / 6, 0, 1)
    stage: Array = (wall * (1 - blend) + boards * blend) * (1 - 0.35 * x**2 * np.clip(y / horizon, 0, 1))
    fade = np.clip((height - y) / 40, 0, 1)
    return stage * fade + BACKDROP * (1 - fade)


def _over(layer: Array, left: int, tile: Array) -> None:
    """Lay a tile with premultiplied alpha over a layer with or without alpha, cut at its edges."""
    first, last = max(0, left), min(layer.shape[1], left + tile.shape[1])
    part = tile[:, first - left : last - left]
    channels = layer.shape[2]
    layer[:, first:last] = part[..., :channels] + layer[:, first:last] * (1 - part[..., 3:])


def _straight(premultiplied: Array) -> Array:
    """Colours (.., 4) whose alpha is not multiplied in, as picture files have them."""
    straight = premultiplied.copy()
    straight[..., :3] /= np.maximum(straight[..., 3:], 1e-6)
    return straight


def _draw_trails(axes: Any, trails: list[Array]) -> None:
    from matplotlib.collections import LineCollection

    for pixels in trails:
        pieces = np.stack([pixels[:-1], pixels[1:]], axis=1)
        ages = np.linspace(0, 1, len(pieces))
        colours = np.concatenate([np.tile(VERMILION, (len(pieces), 1)), ages[:, None] ** 1.3], axis=1)
        widths = 1.0 + 3.5 * ages
        axes.add_collection(
            LineCollection(list(pieces), colors=colours, linewidths=widths, capstyle="butt", zorder=1)
        )


def _write(axes: Any, stage: _Stage, title: str, coloured: str) -> None:
    """Title, legend, labels of the rows and time stamps."""
    axes.set_xlim(0, stage.floor.shape[1])
    axes.set_ylim(stage.floor.shape[0], 0)
    axes.text(MARGIN_PX, 42, title or "Filmstrip", color=INK, fontsize=19, va="center")
    if coloured:
        axes.plot([MARGIN_PX + 6], [78], "o", color=VERMILION, markersize=8, zorder=3)
        axes.text(MARGIN_PX + 22, 78, coloured, color=FAINT, fontsize=11, va="center")
    for x, y, text in stage.times:
        axes.text(x, y, text, color=FAINT, fontsize=9.5, ha="center", va="center")
    for y, text in stage.labels:
        axes.text(MARGIN_PX, y, text, color=INK, fontsize=12, va="top")
