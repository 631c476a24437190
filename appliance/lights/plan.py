"""A picture of the rig, from above and from the audience: fixtures, their light, the dancer in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from appliance.lights.beams import LAMP, Beam
from appliance.lights.label_places import Rectangle, free_place
from appliance.lights.lamp_symbols import DARK_LEVEL, FAINT, INK, KINDS, draw_symbol
from appliance.lights.light_picture import Space, haze, on_floor, reaching, shown
from appliance.pictures.figure import Frame, render
from appliance.pictures.filmstrip import MissingPicturesError, every_script
from appliance.pictures.filmstrip_stage import IVORY, straight
from appliance.pose.body import Cones
from appliance.pose.counted import counted
from appliance.pose.quaternion import Array
from appliance.pose.whole_file import written_whole

DARK, GRID, WALL = "#0b0c10", "#ffffff12", "#3a3e4a"
FLOOR = np.array([0.0052, 0.0056, 0.0080])  # linear
MARGIN_M, LONGEST_BEAM_M = 1.0, 12.0
FLOOR_EDGE_M = 0.09  # the floor seen from its edge
BELOW_M = 0.4  # the view from the audience begins so far below the floor
POOLS_WITHIN_M = 2.0  # light that lands farther from the lamps is cut off at the walls
AMBIENT = 0.28  # how much of the dancer's colour is seen where no light falls
VIEWS = (("From above", 0, 2), ("From the audience", 0, 1))  # title, axis to the right, axis upwards
WIDTH_PX, LEFT_PX, BETWEEN_PX, RIGHT_PX, HEADER_PX, FOOTER_PX = 1500, 64, 84, 24, 122, 108
STEP_PX = 2  # light is soft: a value every second pixel, the rest between them
TALLEST = 1.35  # a view's height to its width, at most
ROOT_PX = 46  # no label covers so much of a beam
LEADER_PX = 22  # a label farther away has a line to its lamp


def draw_plan(path: Path, beams: Sequence[Beam], dancer: Cones, trail: Array, title: str, scene: str) -> Path:
    """Draw the rig into a PNG and return its path.

    Each beam has its colour, width and level; the aim of a dark head is dashed. dancer: in the moment that
    the beams belong to, metres; trail: (N, 3) metres, the root's way through the phrase; scene: a line about
    that moment. Raises MissingPicturesError.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPicturesError from error
    space = drawn_space(beams, dancer, trail)
    wide_px = (WIDTH_PX - LEFT_PX - BETWEEN_PX - RIGHT_PX) / 2
    scale = wide_px / (space.high[0] - space.low[0])
    high_px = round(scale * (space.high[1] - space.low[1]))
    height_px = HEADER_PX + high_px + FOOTER_PX
    figure = Figure(figsize=(WIDTH_PX / 100, height_px / 100), dpi=100, facecolor=DARK)
    canvas: Any = FigureCanvasAgg(figure)
    with every_script():
        left, unnamed = float(LEFT_PX), 0
        for view in VIEWS:
            place = (left / WIDTH_PX, FOOTER_PX / height_px, wide_px / WIDTH_PX, high_px / height_px)
            drawn = _View(figure.add_axes(place), view, space, scale, beams)
            drawn.draw(dancer, trail)
            unnamed = max(unnamed, drawn.unnamed)
            left += wide_px + BETWEEN_PX
        if unnamed:
            scene += f"; no room for {counted(unnamed, 'label')}: the table has every name"
        edge, top = LEFT_PX / WIDTH_PX, 1 - 40 / height_px
        figure.text(edge, top, title, color=INK, fontsize=20, va="center")
        figure.text(edge, top - 32 / height_px, scene, color=FAINT, fontsize=11.5, va="center")
        _key(figure, beams, height_px)
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as beside:
            canvas.print_png(beside)
    return path


def drawn_space(beams: Sequence[Beam], dancer: Cones, trail: Array) -> Space:
    """Everything and a margin; as deep as it is high, so that both views have one size and one scale."""
    lamps = np.array([beam.place for beam in beams])
    bounds = lamps.min(axis=0) - POOLS_WITHIN_M, lamps.max(axis=0) + POOLS_WITHIN_M
    pools = [np.clip(rim, *bounds) for rim in map(_rim, beams) if rim is not None]
    points = np.concatenate([lamps, dancer.start, trail, [[-2, 0, -2], [2, 0, 2]], *pools])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    low[1] = -BELOW_M
    wide, tall, deep = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    side = max(tall, deep)
    high[1] += side - tall
    low[2], high[2] = low[2] - (side - deep) / 2, high[2] + (side - deep) / 2
    more = max(side / TALLEST - wide, 0.0) / 2
    low[0], high[0] = low[0] - more, high[0] + more
    return Space(low, high)


def _rim(beam: Beam) -> Array | None:
    """Where the edge of a lit beam meets the floor, (P, 3) metres; None where some of it never does."""
    aside = np.cross(beam.direction, [1.0, 0.0, 0.0] if abs(beam.direction[0]) < 0.9 else [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside)
    angles = np.linspace(0.0, 2.0 * np.pi, 24)[:, None]
    around = np.cos(angles) * aside + np.sin(angles) * np.cross(beam.direction, aside)
    ways = beam.direction + np.tan(np.radians(beam.degrees / 2)) * around
    if beam.level < DARK_LEVEL or beam.place[1] <= 0.0 or (ways[:, 1] > -0.05).any():
        return None
    rim: Array = beam.place - ways * (beam.place[1] / ways[:, 1:2])
    return rim


class _View:
    """One projection of the space: two of its axes, in metres. unnamed: lamps without room for a label."""

    def __init__(
        self, axes: Any, view: tuple[str, int, int], space: Space, scale: float, beams: Sequence[Beam]
    ) -> None:
        self._axes, self._space, self._scale = axes, space, scale
        self._beams = [beam for beam in beams if beam.level >= DARK_LEVEL]
        self._dark = [beam for beam in beams if beam.level < DARK_LEVEL and beam.kind != LAMP]
        self._fixtures = list({beam.fixture.name: beam for beam in beams}.values())
        title, self._right, self._up = view
        self._is_plan = self._up == 2
        self._wide, self._high = (
            round(scale * (space.high[axis] - space.low[axis])) for axis in (0, self._up)
        )
        self._taken: list[Rectangle] = []
        self.unnamed = 0
        axes.set_title(title, color=INK, fontsize=13, loc="left", pad=9)
        self._frame()

    def draw(self, dancer: Cones, trail: Array) -> None:
        self._picture(self._light(), zorder=0, smooth=True)
        if self._is_plan:
            self._axes.plot(*self._flat(trail).T, color=INK, lw=0.8, alpha=0.32, zorder=2)
        self._picture(straight(self._lit(dancer)), zorder=4, smooth=False)
        for beam in self._dark:
            ends = np.array([beam.place, beam.place + beam.direction * _length(beam)])
            self._axes.plot(*self._flat(ends).T, color=FAINT, lw=0.9, ls=(0, (2, 4)), zorder=3)
        for beam in self._fixtures:
            draw_symbol(self._axes, self._flat(beam.place), self._flat(beam.direction), beam, 1 / self._scale)
        self._label_all()

    def _frame(self) -> None:
        """The walls, a 1 m grid, and the audience."""
        axes, (low, high) = self._axes, self._space
        axes.set_xlim(low[0], high[0])
        up = (low[self._up], high[self._up])
        axes.set_ylim(up[::-1] if self._is_plan else up)
        axes.set_facecolor(DARK)
        from matplotlib.ticker import MultipleLocator

        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MultipleLocator(1))
        axes.grid(color=GRID, lw=0.8)
        axes.set_axisbelow(False)
        axes.tick_params(colors=FAINT, labelsize=9, length=0)
        for side in axes.spines.values():
            side.set_color(WALL)
            side.set_linewidth(1.5)
        axes.set_xlabel("x, metres: to the dancer's left", color=FAINT, fontsize=10)
        axes.set_ylabel(
            "z, metres: to the audience" if self._is_plan else "y, metres: up", color=FAINT, fontsize=10
        )
        if self._is_plan:
            box = self._write("audience", (self._wide / 2, 12.0), FAINT, 11).get_window_extent()
            left, half = self._wide / 2 - box.width / 2, box.height / 2
            self._taken.append(Rectangle(left, 12.0 - half, left + box.width, 12.0 + half))
        else:
            floor = self._pixels(np.zeros(3))[1]
            self._taken.append(Rectangle(0.0, floor - self._scale * FLOOR_EDGE_M, self._wide, floor))

    def _light(self) -> Array:
        """Floor and light, (rows, columns, 3), in the order of the picture's own rows."""
        shape = (self._high // STEP_PX, self._wide // STEP_PX)
        light = haze(self._beams, self._space, self._right, self._up, shape)
        x, up = (
            np.linspace(self._space.low[axis], self._space.high[axis], count)
            for axis, count in ((self._right, shape[1]), (self._up, shape[0]))
        )
        if self._is_plan:
            light += on_floor(self._beams, x, up)
        else:
            z = np.linspace(self._space.low[2], self._space.high[2], 80)
            light[up < 0] = 0.0
            light[(up < 0) & (up > -FLOOR_EDGE_M)] = FLOOR + on_floor(self._beams, x, z).max(axis=0)
        pictured: Array = shown(light + FLOOR)
        return pictured[::-1] if not self._is_plan else pictured

    def _lit(self, dancer: Cones) -> Array:
        """The dancer (rows, columns, 4) in the light that reaches each limb."""
        received = shown(reaching(self._beams, (dancer.start + dancer.end) / 2))
        colours = IVORY * (AMBIENT + (1.0 - AMBIENT) * received)
        turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) if self._is_plan else np.eye(3)
        seen = replace(dancer, start=dancer.start @ turn.T, end=dancer.end @ turn.T)
        top = -self._space.low[2] if self._is_plan else self._space.high[1]
        frame = Frame(
            self._wide, self._high, -self._scale * self._space.low[0], self._scale * top, self._scale
        )
        covered = [self._pixels(point) for point in (*dancer.start, *dancer.end)]
        low, high = np.min(covered, axis=0) - 6, np.max(covered, axis=0) + 6
        self._taken.append(Rectangle(*low, *high))
        return render(seen, colours, frame)

    def _picture(self, colours: Array, zorder: float, smooth: bool) -> None:
        low, high = self._space
        ends = (low[self._up], high[self._up])
        self._axes.imshow(
            np.clip(colours, 0, 1),
            extent=(low[0], high[0], *(ends[::-1] if self._is_plan else ends)),
            interpolation="bilinear" if smooth else "nearest",
            aspect="auto",
            zorder=zorder,
        )

    def _label_all(self) -> None:
        """Name, universe and channel, level of each lamp: beside it, on nothing else."""
        for beam in self._fixtures:
            at = self._pixels(beam.place)
            reach = KINDS[beam.kind][1] + 3
            self._taken.append(Rectangle(*(at - reach), *(at + reach)))
            way = np.array([1, -1 if self._is_plan else 1]) * self._flat(beam.direction)
            steps = np.arange(8, ROOT_PX, 6)[:, None] * way
            around = [Rectangle(*(at + step - 4), *(at + step + 4)) for step in steps]
            self._taken += around if beam.level >= DARK_LEVEL else []
        for beam in sorted(self._fixtures, key=lambda one: tuple(self._pixels(one.place))):
            fixture = beam.fixture
            address = f"{fixture.universe}/{fixture.address}"
            texts = (f"{fixture.name}\n{address} · {100 * beam.level:.0f} %", address)
            self.unnamed += not any(self._label(beam, text) for text in texts)

    def _label(self, beam: Beam, text: str) -> bool:
        """Whether there was room for it."""
        at = self._pixels(beam.place)
        written = self._write(text, (0.0, 0.0), INK, 8.5)
        box = written.get_window_extent()
        walls = Rectangle(4.0, 4.0, self._wide - 4.0, self._high - 4.0)
        way = np.array([1, -1 if self._is_plan else 1]) * self._flat(beam.direction)
        found = free_place(at, (box.width, box.height), -way, self._taken, walls)
        if found is None:
            written.remove()
            return False
        self._taken.append(found)
        middle = np.array(found.middle)
        written.set_position(self._metres(middle))
        near = np.clip(at, [found.left, found.bottom], [found.right, found.top])
        if np.linalg.norm(near - at) > LEADER_PX:
            self._axes.plot(
                *np.array([self._metres(at), self._metres(near)]).T, color=FAINT, lw=0.7, zorder=5
            )
        return True

    def _write(self, text: str, at: tuple[float, float], colour: str, size: float) -> Any:
        from matplotlib.patheffects import withStroke

        written = self._axes.text(
            *self._metres(np.array(at)), text, color=colour, fontsize=size, ha="center", va="center", zorder=9
        )
        written.set_path_effects([withStroke(linewidth=2.5, foreground="#0b0c10c0")])
        return written

    def _pixels(self, point: Array) -> Array:
        """From the bottom left of the view."""
        flat, (low, high) = self._flat(point), self._space
        up = high[self._up] - flat[1] if self._is_plan else flat[1] - low[self._up]
        pixels: Array = self._scale * np.array([flat[0] - low[0], up])
        return pixels

    def _metres(self, pixels: Array) -> Array:
        low, high = self._space
        x, up = pixels / self._scale
        return np.array([low[0] + x, high[self._up] - up if self._is_plan else low[self._up] + up])

    def _flat(self, points: Array) -> Array:
        """The two coordinates that this view shows."""
        flat: Array = np.asarray(points)[..., [self._right, self._up]]
        return flat


def _key(figure: Any, beams: Sequence[Beam], height_px: float) -> None:
    """The symbols of the kinds that hang here, by name."""
    axes = figure.add_axes((0, 0, 1, 50 / height_px))
    axes.set_xlim(0, WIDTH_PX)
    axes.set_ylim(0, 50)
    axes.set_axis_off()
    x = LEFT_PX + 12.0
    first = {beam.kind: beam for beam in beams}
    entries = [kind for kind in KINDS if kind in first] + ["walked path"]
    if any(beam.level < DARK_LEVEL and beam.kind != LAMP for beam in beams):
        entries.append("aim of a dark head")
    for entry in entries:
        if entry in first:
            draw_symbol(axes, np.array([x, 26.0]), np.array([0.0, -0.9]), first[entry], 1.0)
        else:
            style = {"ls": (0, (2, 4)), "color": FAINT} if "dark" in entry else {"color": INK, "alpha": 0.4}
            axes.plot([x - 12, x + 12], [26, 26], lw=1.0, **style)
        name = axes.text(x + 24, 26, entry, color=FAINT, fontsize=9.5, va="center_baseline")
        x += 24 + name.get_window_extent().width + 44
    axes.text(
        WIDTH_PX - RIGHT_PX,
        26,
        "1/61 · 38 %: universe, channel, level",
        color=FAINT,
        fontsize=9.5,
        ha="right",
        va="center_baseline",
    )


def _length(beam: Beam) -> float:
    """Metres along a beam to the floor."""
    if beam.direction[1] >= -1e-3:
        return LONGEST_BEAM_M
    return min(float(beam.place[1] / -beam.direction[1]), LONGEST_BEAM_M)
