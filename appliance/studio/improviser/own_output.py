"""Behaviour of a pose-by-pose improviser on its own output: the report at the end of its training.

Such networks have two faults: at the training's temperature the dance trembles, with less of it the dance
freezes. Both are measured as for every generated dance, beside the recordings' own figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from torch import Tensor

from appliance.pictures.filmstrip import Strip, draw_strips
from appliance.studio.dance_files import write_report
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.coders import Poses
from appliance.studio.improviser.naturalness import Naturalness, Yardstick, measure
from appliance.studio.improviser.pose_mixtures_training import PoseMixturesTraining, load_pose_improviser
from appliance.studio.improviser.pose_steps import pose_stretches

TEMPERATURES = (1.0, 0.5, 0.0)  # as trained; calmer; the likeliest Gaussian's mean, as the published notebook
DANCES, SECONDS = 4, 20.0
COLUMNS = 8  # in a picture


@dataclass(frozen=True)
class Row:
    """Means over dances; longest_still_s: their maximum. Speed and breadth: of the recordings'."""

    trembling: float
    longest_still_s: float
    speed: float
    breadth: float
    strangeness: float
    slide_cm_s: float

    @staticmethod
    def of(dances: Sequence[Naturalness]) -> Row:
        return Row(
            float(np.mean([one.pace.trembling for one in dances])),
            max(one.pace.longest_still_s for one in dances),
            float(np.mean([one.liveliness for one in dances])),
            float(np.mean([one.likeness.breadth for one in dances])),
            float(np.mean([one.likeness.strangeness for one in dances])),
            float(np.mean([one.slide_cm_s for one in dances])),
        )


def report(training: PoseMixturesTraining, checkpoint: Path, console: Console) -> None:
    """Dance after held-out starts at each temperature; print the table, write report.json and dances.png."""
    dataset = training.dataset
    improviser, _ = load_pose_improviser(checkpoint)
    yardstick = Yardstick.of(dataset.training, dataset.moving)
    starts = _starts(training, improviser.rest)
    rows, strips = {}, []
    for temperature in TEMPERATURES:
        dances = improviser.dances(starts, dataset, SECONDS, temperature, training.settings.seed)
        rows[temperature] = Row.of([measure(dance, yardstick, endless=False) for dance in dances])
        strips.append(Strip(dances[0].poses, dances[0].roots, f"temperature {temperature:g}"))
    recorded = yardstick.pace
    found = training.history[-1].held_out if training.history else {}
    write_report(
        checkpoint.with_name("report.json"),
        {
            "network": asdict(training.network.shape),
            "steps": training.step,
            "minutes": training.seconds / 60,
            "held_out": found,
            "temperatures": {str(one): asdict(row) for one, row in rows.items()},
            "recordings": {
                "trembling": recorded.trembling,
                "longest_still_s": recorded.longest_still_s,
                "slide_cm_s": yardstick.slide_cm_s,
            },
        },
    )
    title = f"{SECONDS:g} s on its own output after a held-out start"
    draw_strips(checkpoint.with_name("dances.png"), dataset.skeleton, strips, FPS, title, columns=COLUMNS)
    Console().print(_table(rows, yardstick, title))
    if found:
        console.print(
            f"Held-out takes: {found['nats']:.2f} nats a number; {found['gaussian']:.2f} without looking "
            f"back, {found['stays']:.2f} for a pose that stays where it was. Less is better.",
            highlight=False,
        )


def _starts(training: PoseMixturesTraining, rest: Poses) -> Tensor:
    """(DANCES, back, features): looks back at takes that were kept apart, or at the others."""
    dataset, back = training.dataset, training.settings.window
    takes = dataset.held_out if len(training.held_starts) else dataset.training
    long = pose_stretches(takes, dataset.moving, rest, back)
    chosen = np.linspace(0, len(long) - 1, DANCES).round().astype(int)
    return torch.stack([long[number][-back:] for number in chosen])


def _table(rows: dict[float, Row], yardstick: Yardstick, title: str) -> Table:
    table = Table(title=title, box=SIMPLE_HEAD)
    table.add_column("temperature", no_wrap=True)
    for name in ("above 8 Hz", "longest still", "speed", "breadth", "strangeness", "slide"):
        table.add_column(name, justify="right")
    for temperature, row in rows.items():
        table.add_row(
            f"{temperature:g}",
            f"{row.trembling:.1%}",
            f"{row.longest_still_s:.1f} s",
            f"{row.speed:.2f}",
            f"{row.breadth:.2f}",
            f"{row.strangeness:.2f}",
            f"{row.slide_cm_s:.0f} cm/s",
        )
    own = yardstick.pace
    table.add_row(
        "recordings",
        f"{own.trembling:.1%}",
        f"{own.longest_still_s:.1f} s",
        "1.00",
        "1.00",
        "1.00",
        f"{yardstick.slide_cm_s:.0f} cm/s",
    )
    return table
