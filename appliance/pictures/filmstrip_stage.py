"""The stage of a filmstrip: figures beside each other on boards, their shadows and trails, in layers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from appliance.pictures.figure import Frame, floor_shadow, render
from appliance.pose.body import Body, Cones
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

COLUMN_PX, TILE_PX = 176, 320  # figures stand closer than their arms reach: tiles overlap; at least
MARGIN_PX, HEADER_PX, FOOTER_PX, LABEL_PX = 56, 104, 44, 22
HEIGHT_PX = 300  # the figure in its rest pose
AZIMUTH, ELEVATION = np.radians(32), np.radians(11)
TRAIL_S = 0.6
SHADOW = 0.85
IVORY, VERMILION = np.array([0.93, 0.87, 0.78]), np.array([0.96, 0.27, 0.13])
SLATE = np.array([0.62, 0.70, 0.80])
BACKDROP, HORIZON, BOARDS = (np.array(c) / 255 for c in ([15, 16, 21], [37, 38, 47], [104, 88, 78]))
GHOST = 0.55  # opacity of the figure behind another one


@dataclass(frozen=True)
class Row:
    """Poses drawn beside each other: local rotations (N, J, 4), roots (N, 3) metres, a label, a colour.

    chosen: which of the N; behind: a row drawn as ghosts behind these figures; holds: (N, J) 0..1, how far
    each joint is in colour; stamps: words below the figures, by default their seconds.
    """

    poses: Array
    roots: Array
    chosen: NDArray[np.int64]
    label: str = ""
    colour: Array = field(default_factory=lambda: IVORY)
    behind: Row | None = None
    holds: Array | None = None
    stamps: tuple[str, ...] | None = None


class Stage:
    """The picture in layers: the floor with its shadows, the trails, the figures; and where words belong."""

    def __init__(self, skeleton: Skeleton, rows: Sequence[Row], fps: float, start_s: float = 0.0) -> None:
        """start_s: second of the recording at which the rows begin, which the stamps count from."""
        self.skeleton, self.fps, self.start_s = skeleton, fps, start_s
        self.body = Body(skeleton)
        self.scale = HEIGHT_PX / self.body.height
        self.times: list[tuple[float, float, str]] = []
        self.labels: list[tuple[float, str]] = []
        self.trails: list[tuple[Array, Array]] = []  # pixels (n, 2) from old to new, how firmly held (n,)
        columns = max(len(row.chosen) for row in rows)
        above = self._highest(rows)
        labels = LABEL_PX if any(row.label for row in rows) else 0
        self.floor_px = round(above * self.scale * np.cos(ELEVATION)) + 24 + labels
        self.row_px = self.floor_px + FOOTER_PX + 34
        reach_px = math.ceil(self._widest(rows) * self.scale) + MARGIN_PX // 2
        self.tile_px = max(TILE_PX, 2 * reach_px)
        self.margin_px = max(MARGIN_PX, reach_px - COLUMN_PX // 2)
        width = 2 * self.margin_px + max(columns * COLUMN_PX, 3 * COLUMN_PX)
        self.floor = np.tile(BACKDROP, (HEADER_PX + self.row_px * len(rows), width, 1))
        self.figures = np.zeros((*self.floor.shape[:2], 4))
        for number, row in enumerate(rows):
            self._draw_row(row, HEADER_PX + number * self.row_px)

    def _highest(self, rows: Sequence[Row]) -> float:
        """How far anything reaches above the floor, metres."""
        reaches = []
        for row in rows:
            positions, _ = self.skeleton.forward_kinematics(row.poses[row.chosen], row.roots[row.chosen])
            reaches.append(float(positions[..., 1].max()) - self._floor(row))
        return max(reaches) + 0.09 * self.body.height

    def _widest(self, rows: Sequence[Row]) -> float:
        """How far a joint is seen beside the middle of its figure, at most, metres."""
        widest = 0.0
        for row in rows:
            for one in filter(None, (row, row.behind)):
                here = one.roots[one.chosen] * [1, 0, 1]
                positions, _ = self.skeleton.forward_kinematics(one.poses[one.chosen], one.roots[one.chosen])
                seen = (positions - here[:, None]) @ _view().T
                widest = max(widest, float(np.abs(seen[..., 0]).max()))
        return widest

    def _floor(self, row: Row) -> float:
        """Height of the floor, metres: where the lowest joint of most instants is."""
        positions, _ = self.skeleton.forward_kinematics(row.poses[row.chosen], row.roots[row.chosen])
        return float(np.percentile(positions[..., 1].min(axis=-1), 20)) - 0.017 * self.body.height

    def _draw_row(self, row: Row, top: int) -> None:
        rows = slice(top, top + self.row_px)
        self.floor[rows] = _empty_stage(self.floor.shape[1], self.row_px, self.floor_px)
        floor = self._floor(row)
        for column, index in enumerate(row.chosen):
            centre = self.margin_px + (column + 0.5) * COLUMN_PX
            self._figure(row, int(index), centre, floor, rows)
            self._trail(row, int(index), centre, floor, top)
            stamp = row.stamps[column] if row.stamps else f"{self.start_s + index / self.fps:.1f} s"
            self.times.append((centre, top + self.floor_px + FOOTER_PX, stamp))
        if row.label:
            self.labels.append((top + 12, row.label))

    def _figure(self, row: Row, index: int, centre: float, floor: float, rows: slice) -> None:
        """Lay one figure, its shadow and the ghost behind it into their layers."""
        left = round(centre - self.tile_px / 2)
        frame = Frame(self.tile_px, self.row_px, centre - left, self.floor_px, self.scale)
        if row.behind is not None:
            ghost = self._cones(row.behind, index, floor)
            dim = np.tile(row.behind.colour, (len(ghost.joint), 1))
            _over(self.figures[rows], left, GHOST * render(_seen(ghost), dim, frame))
        cones = self._cones(row, index, floor)
        on_stage = replace(cones, start=cones.start @ _turn().T, end=cones.end @ _turn().T)
        _over(self.floor[rows], left, self._shadow(on_stage, frame))
        colours = np.tile(row.colour, (len(cones.joint), 1))
        if row.holds is not None:
            colours += row.holds[index][cones.joint][:, None] * (VERMILION - colours)
        _over(self.figures[rows], left, render(_seen(cones), colours, frame))

    def _cones(self, row: Row, index: int, floor: float) -> Cones:
        """The volume of one figure over the middle of its place."""
        ground = row.roots[index] * [1, 0, 1] + [0, floor, 0]
        positions, world = self.skeleton.forward_kinematics(row.poses[index], row.roots[index])
        return self.body.cones(positions - ground, world)

    def _shadow(self, cones: Cones, frame: Frame) -> Array:
        """Black, the floor's darkness as alpha, (height, width, 4); reckoned at half the resolution."""
        first = max(0, self.floor_px - 80) // 2
        height = frame.height // 2 - first
        half = Frame(frame.width // 2, height, frame.x0 / 2, frame.y0 / 2 - first, frame.pixels_per_metre / 2)
        dark = np.kron(floor_shadow(cones, 0.0, float(np.sin(ELEVATION)), half), np.ones((2, 2)))
        shadow = np.zeros((frame.height, frame.width, 4))
        shadow[2 * first : 2 * first + len(dark), : dark.shape[1], 3] = SHADOW * dark
        return shadow

    def _trail(self, row: Row, index: int, centre: float, floor: float, top: int) -> None:
        """The way that the end of each bone has gone while it was held."""
        if row.holds is None:
            return
        first = max(0, index - round(TRAIL_S * self.fps))
        here = row.roots[index] * [1, 0, 1] + [0, floor, 0]
        span = slice(first, index + 1)
        positions, _ = self.skeleton.forward_kinematics(row.poses[span], row.roots[span])
        for joint in np.flatnonzero(row.holds[span].any(axis=0)).tolist():
            child = next((c for c, p in enumerate(self.skeleton.parents) if p == joint), joint)
            seen = (positions[:, child] - here) @ _view().T * self.scale
            pixels = np.stack([centre + seen[:, 0], top + self.floor_px - seen[:, 1]], axis=-1)
            self.trails.append((pixels, row.holds[span, joint]))


def straight(premultiplied: Array) -> Array:
    """Colours (.., 4) whose alpha is not multiplied in, as picture files have them."""
    colours = premultiplied.copy()
    colours[..., :3] /= np.maximum(colours[..., 3:], 1e-6)
    return colours


def _seen(cones: Cones) -> Cones:
    """Cones of the stage as the camera sees them."""
    return replace(cones, start=cones.start @ _view().T, end=cones.end @ _view().T)


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
