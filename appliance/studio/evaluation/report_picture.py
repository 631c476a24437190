"""report.png: a dancer's errors, latents and quantization on one page for the artist."""

from __future__ import annotations

import tempfile
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from appliance.studio.data.dataset import Take
from appliance.studio.evaluation.coders import Coder
from appliance.studio.evaluation.evaluation import Evaluation
from appliance.studio.evaluation.pictures import (
    FAINT,
    INK,
    IVORY,
    PANEL,
    SLATE,
    VERMILION,
    draw_reconstruction,
    dressed,
    new_figure,
    save,
)

WIDTH_INCHES = 15.0
STRIP_SHARE = 0.58  # height of the filmstrip by its width
LETTERS_IN_A_ROW = 200  # were all joints' names as long as the longest; more run into each other
LABEL_PT, SLANTED_LABELS_PT = 8.0, 540.0  # slanted ones are smaller where more than 67 stand side by side
ALIVE = {
    "critic": "critic\n(0.5: cannot tell)",
    "critic_legs": "critic,\nlegs",
    "critic_moving": "critic, with\nspeed and jerk",
    "spread_legs": "spread,\nlegs (1)",
    "spread_trunk": "spread,\ntrunk (1)",
    "energy_legs": "energy,\nlegs (1)",
    "energy_trunk": "energy,\ntrunk (1)",
    "energy_arms": "energy,\nfree arms (1)",
    "coupling_fidelity": "coupling to\nthe hand (1)",
    "memorisation": "memorisation\n(0: one moment)",
}
COLOURS = {"phrase": IVORY, "pasted": FAINT, "network": VERMILION, "matching": SLATE}
MOST_SHOWN = 2.0  # a bar that is longer says no more
SLANTED: dict[str, Any] = {"rotation": 40, "ha": "right", "rotation_mode": "anchor"}


def draw_report(
    path: Path, name: str, report: dict[str, Any], evaluation: Evaluation, coder: Coder, take: Take
) -> Path:
    """Filmstrip of a take and its reconstruction; errors by joint and by iterations; latents; int8; the held
    dance beside its baselines, where there were enough recordings to compare it.
    """
    import matplotlib.image

    compared = alive(report)
    figure = new_figure(WIDTH_INCHES, WIDTH_INCHES * STRIP_SHARE + 8.4 + 4.2 * bool(compared))
    figure.suptitle(_headline(name, report), color=INK, fontsize=15, x=0.01, ha="left")
    figure.get_layout_engine().set(w_pad=0.15, h_pad=0.12)
    heights = [WIDTH_INCHES * STRIP_SHARE, 3.6, 3.6, *[3.6] * bool(compared)]
    grid = figure.add_gridspec(len(heights), 3, height_ratios=heights)
    with tempfile.TemporaryDirectory() as folder:
        title = (
            f"{take.name}, a take that it never saw"
            if take.name in report["training"]["held_out"]
            else take.name
        )
        strip = matplotlib.image.imread(draw_reconstruction(Path(folder) / "strip.png", coder, take, title))
    axes = figure.add_subplot(grid[0, :])
    axes.imshow(strip, interpolation="antialiased")
    axes.set_axis_off()
    draw_joints(dressed(figure.add_subplot(grid[1, :])), report)
    _by_iterations(dressed(figure.add_subplot(grid[2, 0])), report)
    _latents(dressed(figure.add_subplot(grid[2, 1])), evaluation)
    _quantization(dressed(figure.add_subplot(grid[2, 2])), report)
    if compared:
        draw_alive(dressed(figure.add_subplot(grid[3, :])), compared)
    return save(figure, path)


def alive(report: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Baseline to figures of ALIVE, means over the hands; empty where the report compares no dances."""
    rows = [one["baselines"] for one in report.get("puppetry", {}).values() if "baselines" in one]
    found: dict[str, dict[str, float]] = {}
    for kind in (kind for kind in COLOURS if rows and all(kind in row for row in rows)):
        known = {name: [row[kind][name] for row in rows if row[kind][name] is not None] for name in ALIVE}
        found[kind] = {name: fmean(values) for name, values in known.items() if values}
    return found


def draw_alive(axes: Any, compared: dict[str, dict[str, float]]) -> None:
    """The figures of the held dance, a bar for each baseline."""
    names = [name for name in ALIVE if any(name in row for row in compared.values())]
    width = 0.8 / len(compared)
    for number, (kind, row) in enumerate(compared.items()):
        places = [place + (number + 0.5) * width - 0.4 for place, name in enumerate(names) if name in row]
        heights = [min(row[name], MOST_SHOWN) for name in names if name in row]
        axes.bar(places, heights, width, color=COLOURS[kind], label=kind)
    axes.axhline(1.0, color=FAINT, linewidth=0.8)
    axes.set_xticks(range(len(names)), [ALIVE[name] for name in names], color=INK, fontsize=LABEL_PT)
    axes.set_ylim(0, 1.2 * axes.get_ylim()[1])
    _titled(
        axes,
        "Is the held dance alive? Beside it: the phrase, the phrase with the arm pasted on, motion matching",
    )
    _legend(axes)


def _headline(name: str, report: dict[str, Any]) -> str:
    once, often = report["degrees"]["1"]["mean"], report["degrees"]["10"]["mean"]
    return (
        f"{name}: coded once, a joint is {once:.1f} degrees from the dancer's; ten times, {often:.1f}: "
        f"that is how far it goes its own way"
    )


def draw_joints(axes: Any, report: dict[str, Any]) -> None:
    """The error of each joint, coded once and ten times; long rows of names are slanted."""
    once, often = report["by_joint_degrees"]["1"], report["by_joint_degrees"]["10"]
    places = np.arange(len(once))
    axes.bar(places - 0.2, list(often.values()), 0.4, color=SLATE, label="coded ten times")
    axes.bar(places + 0.2, list(once.values()), 0.4, color=VERMILION, label="coded once")
    crowded = len(once) * max(map(len, once)) > LETTERS_IN_A_ROW
    size = min(LABEL_PT, SLANTED_LABELS_PT / len(once))
    axes.set_xticks(places, list(once), color=INK, fontsize=size, **(SLANTED if crowded else {}))
    axes.set_ylim(top=1.2 * axes.get_ylim()[1])  # room for the legend
    _titled(axes, "Which joints it knows best (mean error in degrees)")
    _legend(axes)


def _by_iterations(axes: Any, report: dict[str, Any]) -> None:
    counts = [int(k) for k in report["degrees"]]
    for key, colour, label in (("mean", VERMILION, "mean"), ("p95", IVORY, "95 of 100 are below")):
        values = [figures[key] for figures in report["degrees"].values()]
        axes.plot(counts, values, "o-", color=colour, label=label)
    axes.set_xticks(counts)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("coding iterations", color=FAINT)
    _titled(axes, "More iterations, further from the phrase (degrees)")
    _legend(axes)


def _latents(axes: Any, evaluation: Evaluation) -> None:
    z = evaluation.latents.ravel()
    axes.hist(z, bins=np.linspace(-4, 4, 81), density=True, color=SLATE, label="latents of the takes")
    x = np.linspace(-4, 4, 200)
    axes.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color=VERMILION, label="the prior, a Gaussian")
    axes.set_yticks([])
    _titled(axes, f"Latents: mean {z.mean():.2f}, standard deviation {z.std():.2f}")
    _legend(axes)


def _quantization(axes: Any, report: dict[str, Any]) -> None:
    gate, times = report["quantization"], report["median_ms_of_ten_iterations"]
    counts = list(gate["degrees"])
    places = np.arange(len(counts))
    axes.bar(
        places - 0.2,
        list(gate["limits_degrees"].values()),
        0.4,
        color=PANEL,
        edgecolor=FAINT,
        label="allowed",
    )
    axes.bar(
        places + 0.2, [gate["degrees"][k]["mean"] for k in counts], 0.4, color=VERMILION, label="int8 to fp32"
    )
    axes.set_xticks(places, [f"after {k}" for k in counts], color=INK)
    took = ", ".join(f"{name} {ms:.2f}" for name, ms in times.items())
    _titled(axes, f"{report['network']['ships']} ships. Ten iterations, ms: {took}")
    axes.set_ylabel("degrees apart", color=FAINT)
    _legend(axes)


def _titled(axes: Any, title: str) -> None:
    axes.set_title(title, color=INK, loc="left", fontsize=11)


def _legend(axes: Any) -> None:
    axes.legend(facecolor=PANEL, edgecolor=PANEL, labelcolor=INK, fontsize=8)
