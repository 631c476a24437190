"""Pictures of a training: losses as curves, and a dance beside its reconstruction."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pictures.filmstrip import draw_filmstrip
from appliance.pose.recording import Recording
from appliance.pose.whole_file import written_whole
from appliance.studio.data.dataset import FPS, Take
from appliance.studio.evaluation.coders import Coder

BACKDROP, PANEL, INK, FAINT = "#0f1015", "#191a21", "#efe6d8", "#9a948c"
VERMILION, SLATE, IVORY = "#f54521", "#9eb3cc", "#edddc7"
STRIP_S = 4.0
COLUMNS = 9  # in a strip
CURVES = {
    "rotation": ("rotation (radians)", VERMILION),
    "pace": ("pace (radians a step)", "#e8a33d"),
    "position": ("position (metres)", IVORY),
    "unit_norm": ("unit norm", "#7d8a5a"),
    "prior": ("prior: the encoder's", SLATE),
    "critic": ("prior: the critic's", "#5f7fa8"),
}


def draw_losses(path: Path, history: Sequence[dict[str, Any]]) -> Path:
    """Two panels over the minutes: every loss, and the error on held-out takes. history: training reports."""
    figure = new_figure(12, 5.2)
    left, right = panels(figure, 1, 2)
    minutes = [line["seconds"] / 60 for line in history]
    for name, (label, colour) in CURVES.items():
        values = [line["losses"].get(name) for line in history]
        if any(value is not None for value in values):
            left.semilogy(minutes, values, label=label, color=colour, linewidth=1.6)
    left.set_title("Losses", color=INK, loc="left")
    left.legend(
        facecolor=PANEL,
        edgecolor=PANEL,
        labelcolor=INK,
        fontsize=8,
        ncols=3,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.13),
    )
    held = [(m, line["held_out_degrees"]) for m, line in zip(minutes, history, strict=True)]
    known = [(m, degrees) for m, degrees in held if degrees is not None]
    if known:
        right.plot(*zip(*known, strict=True), color=VERMILION, linewidth=2)
        right.set_ylim(0, min(max(d for _, d in known), 4 * known[-1][1]) * 1.1)
        title = f"Error on takes kept apart: {known[-1][1]:.2f} degrees a joint"
        right.set_title(title, color=INK, loc="left")
    for axes in (left, right):
        axes.set_xlabel("minutes of training", color=FAINT)
    return save(figure, path)


def draw_learning(path: Path, history: Sequence[dict[str, Any]]) -> Path:
    """An improviser's losses over the minutes, and the same on held-out takes. history: training reports."""
    figure = new_figure(12, 5.2)
    minutes = [line["seconds"] / 60 for line in history]
    titles = {"parts": "Losses", "held_out": "On takes kept apart"}
    for axes, (key, title) in zip(panels(figure, 1, 2), titles.items(), strict=True):
        for name, colour in zip(history[-1][key], (VERMILION, SLATE, IVORY), strict=False):
            values = [line[key].get(name, np.nan) for line in history]
            axes.plot(minutes, values, label=f"{name}: {values[-1]:.3g}", color=colour, linewidth=1.6)
        axes.set_yscale("symlog", linthresh=0.1)
        axes.set_title(title, color=INK, loc="left")
        axes.set_xlabel("minutes of training", color=FAINT)
        if history[-1][key]:
            axes.legend(facecolor=PANEL, edgecolor=PANEL, labelcolor=INK, fontsize=8)
    return save(figure, path)


def draw_reconstruction(path: Path, coder: Coder, take: Take, title: str, iterations: int = 1) -> Path:
    """A filmstrip of a take above its reconstruction after `iterations` iterations."""
    excerpt = longest_sound(take, STRIP_S)
    made = reconstructed(coder, excerpt, iterations)
    return draw_filmstrip(
        path,
        excerpt.skeleton,
        excerpt.poses[: len(made)],
        excerpt.roots[: len(made)],
        FPS,
        title=title,
        columns=COLUMNS,
        against=made,
        labels=("recorded", "coded once" if iterations == 1 else f"coded {iterations} times"),
    )


def reconstructed(coder: Coder, recording: Recording, iterations: int) -> NDArray[np.float64]:
    """(N, J, 4): the recording coded in adjacent windows; an incomplete last window is left out."""
    places = [recording.skeleton.index(name) for name in coder.joints]
    count = len(recording) // coder.window * coder.window
    windows = recording.poses[:count, places].astype(np.float32).reshape(-1, coder.window, len(places), 4)
    made, _ = coder.iterate(windows, iterations)
    whole = np.array(recording.poses[:count], dtype=np.float64)
    whole[:, places] = made.reshape(count, len(places), 4)
    return whole


def longest_sound(take: Take, most_s: float) -> Recording:
    """The middle of a take's longest stretch without a capture error, at most most_s long."""
    first, last = max(take.sound_runs, key=lambda run: run[1] - run[0], default=(0, 0))
    spare = max(0, last - first - round(min(most_s * FPS, len(take.sound)))) // 2
    return take.recording.excerpt((first + spare) / FPS, (last - spare) / FPS)


def new_figure(width: float, height: float) -> Any:
    """A dark figure, inches, drawn without a window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), facecolor=BACKDROP, dpi=100, layout="constrained")


def panels(figure: Any, rows: int, columns: int) -> list[Any]:
    """Axes of a figure, row by row, in the studio's colours."""
    return [dressed(axes) for axes in np.ravel(figure.subplots(rows, columns))]


def dressed(axes: Any) -> Any:
    """Axes in the studio's colours."""
    axes.set_facecolor(PANEL)
    axes.tick_params(colors=FAINT, labelsize=8)
    for spine in axes.spines.values():
        spine.set_color(PANEL)
    axes.grid(color=BACKDROP, linewidth=0.8)
    axes.set_axisbelow(True)
    return axes


def save(figure: Any, path: Path) -> Path:
    """Write a PNG atomically: a viewer may have the old one open."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as beside:
        figure.savefig(beside, format="png", facecolor=BACKDROP)
    return path
