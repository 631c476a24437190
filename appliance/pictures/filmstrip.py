"""Filmstrip: a picture of a dance, instant beside instant, with held joints in colour."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pictures.filmstrip_stage import IVORY, MARGIN_PX, SLATE, VERMILION, Row, Stage, straight
from appliance.pose.correctable_error import CorrectableError
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.pose.whole_file import written_whole

INK, FAINT = "#efe6d8", "#9a948c"
COLUMNS = 10
_MORE_SCRIPTS = (
    *("Noto Sans CJK JP", "Noto Sans CJK SC", "WenQuanYi Zen Hei", "IPAGothic", "Droid Sans Fallback"),
    *("Noto Sans Arabic", "Noto Sans Hebrew", "Noto Sans Devanagari", "Noto Sans Thai"),
)


class MissingPicturesError(CorrectableError):
    """The library that draws pictures is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "Pictures need matplotlib, which is not installed here. The show itself runs without it. "
            "Install it with: pip install 'bunraku[pictures]'"
        )


@dataclass(frozen=True)
class Strip:
    """A dance for a separate row: local unit quaternions (N, J, 4), roots (N, 3) metres, its title.

    behind: a dance drawn as ghosts behind these figures, to show differences; holds: (N, J) how firmly a hand
    holds each joint, 0..1.
    """

    poses: Array
    roots: Array
    label: str = ""
    behind: Strip | None = None
    holds: Array | None = None


def draw_strips(
    path: Path | str,
    skeleton: Skeleton,
    strips: Sequence[Strip],
    fps: float,
    title: str = "",
    columns: int = 8,
    start_s: float = 0.0,
) -> Path:
    """Draw dances of the same length under each other, instant by instant, into a PNG and return its path.

    start_s: second of the recording at which they begin. Raises MissingPicturesError where matplotlib is
    missing, ValueError where there is no pose.
    """
    count = min((len(strip.poses) for strip in strips), default=0)
    chosen = np.linspace(0, count - 1, min(columns, count)).round().astype(np.int64)
    rows = [_row(strip, chosen) for strip in strips]
    return draw_rows(path, skeleton, rows, fps, title, _held(skeleton, rows), start_s)


def _row(strip: Strip, chosen: NDArray[np.int64], colour: Array = IVORY) -> Row:
    behind = None if strip.behind is None else _row(strip.behind, chosen, SLATE)
    poses, roots = np.asarray(strip.poses, float), np.asarray(strip.roots, float)
    return Row(poses, roots, chosen, strip.label, colour, behind, strip.holds)


def draw_filmstrip(
    path: Path | str,
    skeleton: Skeleton,
    poses: Array,
    roots: Array,
    fps: float,
    holds: Array | None = None,
    title: str = "",
    columns: int = COLUMNS,
    rows: int | None = None,
    against: Array | None = None,
    labels: tuple[str, str] = ("original", "reconstruction"),
    start_s: float = 0.0,
) -> Path:
    """Draw columns x rows evenly spaced instants of a dance into a PNG and return its path.

    poses: (N, J, 4) local unit quaternions; roots: (N, 3) metres; fps: poses a second; holds: (N, J) how
    firmly a hand holds each joint, 0..1: its colour, and the way that it has gone while it was held;
    against: other poses (N, J, 4) for a second row below the first, instant by instant (original above
    reconstruction). Two rows unless said otherwise. start_s: second of the recording at which it begins.
    Raises MissingPicturesError where matplotlib is missing, ValueError where there is no pose.
    """
    drawn = _rows(np.asarray(poses, float), np.asarray(roots, float), columns, rows or 2, against, labels)
    drawn = [replace(row, holds=holds) for row in drawn]
    return draw_rows(path, skeleton, drawn, fps, title, _held(skeleton, drawn), start_s)


def held_throughout(poses: Array, joints: Sequence[int]) -> Array:
    """(N, J) holds of a dance (N, J, 4) in which hands hold these joints from its first pose to its last."""
    holds = np.zeros(poses.shape[:2])
    holds[:, list(joints)] = 1.0
    return holds


def _held(skeleton: Skeleton, rows: Sequence[Row]) -> str:
    """Which joints are held at any time, a legend; empty where none is."""
    held = np.zeros(len(skeleton), bool)
    for row in rows:
        if row.holds is not None:
            held |= (row.holds > 0).any(axis=0)
    names = ", ".join(np.array(skeleton.names)[held])
    return f"held: {names}" if names else ""


def draw_rows(
    path: Path | str,
    skeleton: Skeleton,
    rows: Sequence[Row],
    fps: float,
    title: str,
    coloured: str,
    start_s: float = 0.0,
) -> Path:
    """Draw rows under each other, each with its instants, coloured joints and text, into a PNG.

    fps: poses a second; coloured: what the coloured joints are; start_s: as in draw_strips, which raises the
    same.
    """
    matplotlib_figure, canvas = _matplotlib()
    if not rows or not len(rows[0].chosen):
        raise ValueError("a filmstrip needs at least one pose")
    stage = Stage(skeleton, rows, fps, start_s)
    height, width = stage.floor.shape[:2]
    figure = matplotlib_figure(figsize=(width / 100, height / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.add_artist(_layers()(stage.floor, zorder=0))
    _draw_trails(axes, stage.trails)
    axes.add_artist(_layers()(straight(stage.figures), zorder=2))
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with every_script():
        _write(axes, stage, title, coloured)
        with written_whole(path) as beside:
            canvas(figure).print_png(beside)
    return path


@contextmanager
def every_script() -> Iterator[None]:
    """Words in the scripts of the fonts that are installed; a sign that none of them has is an empty box."""
    import matplotlib
    from matplotlib import font_manager

    there = set(font_manager.get_font_names())
    families = ["DejaVu Sans", *(name for name in _MORE_SCRIPTS if name in there)]
    with matplotlib.rc_context({"font.family": families}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        yield


def _matplotlib() -> tuple[Any, Any]:
    """matplotlib's figure and the canvas without a window, loaded when a picture is asked for."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPicturesError from error
    return Figure, FigureCanvasAgg


@cache
def _layers() -> Any:
    """The class of a layer: a picture that lies pixel upon pixel in a figure of its size."""
    from matplotlib.artist import Artist

    class Layer(Artist):
        """Colours (height, width, 3 or 4), 0..1; imshow would resample them first, for ten times as long."""

        def __init__(self, colours: Array, zorder: float) -> None:
            super().__init__()
            self.set_zorder(zorder)
            self._pixels = np.full((*colours.shape[:2], 4), 255, np.uint8)
            self._pixels[::-1, :, : colours.shape[2]] = np.clip(colours, 0, 1) * 255

        def draw(self, renderer: Any) -> None:
            context = renderer.new_gc()
            renderer.draw_image(context, 0, 0, self._pixels)
            context.restore()

    return Layer


def _rows(
    poses: Array, roots: Array, columns: int, rows: int, against: Array | None, labels: tuple[str, str]
) -> list[Row]:
    if against is None:
        count = min(columns * rows, len(poses))
        chosen = np.linspace(0, len(poses) - 1, count).round().astype(np.int64)
        return [Row(poses, roots, chosen[i : i + columns]) for i in range(0, count, columns)]
    chosen = np.linspace(0, len(poses) - 1, min(columns, len(poses))).round().astype(np.int64)
    other = np.asarray(against, float)
    return [Row(poses, roots, chosen, labels[0], IVORY), Row(other, roots, chosen, labels[1], SLATE)]


def _draw_trails(axes: Any, trails: list[tuple[Array, Array]]) -> None:
    from matplotlib.collections import LineCollection

    for pixels, holds in trails:
        pieces = np.stack([pixels[:-1], pixels[1:]], axis=1)
        ages = np.linspace(0, 1, len(pieces))
        colours = np.concatenate(
            [np.tile(VERMILION, (len(pieces), 1)), (holds[1:] * ages**1.3)[:, None]], axis=1
        )
        widths = 1.0 + 3.5 * ages
        axes.add_collection(
            LineCollection(list(pieces), colors=colours, linewidths=widths, capstyle="butt", zorder=1)
        )


def _write(axes: Any, stage: Stage, title: str, coloured: str) -> None:
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
