"""The picture of an evening: eight wearables over time, their states, accepted readings and faults."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from hw_sim.firmware_library import State
from hw_sim.report import IVORY, LOOK, VERMILION
from tests.system.evening import LOOK_S, NAMES, Act, Evening, Look
from tests.system.lockstep import EPOCH_S

LAMP = "#ffd873"
STATES = {
    None: ("off", "#22242d"),
    State.JOINING: ("looks for its network", "#37435c"),
    State.GREETING: ("says hello", "#b98a2f"),
    State.LINKED: ("linked", "#2f5d50"),
}
FULL_RATE_HZ = 50.0
SMOOTHED = 5  # looks
SHORTEST_DRAWN_S = 0.1


def draw_evening(path: Path, evening: Evening) -> None:
    """Write the PNG. Needs matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with matplotlib.rc_context({**LOOK, "ytick.color": IVORY}):
        figure, axes = pyplot.subplots(figsize=(15, 8.5), layout="constrained")
        for row, (looks, sensor) in enumerate(zip(evening.looks, evening.sensors, strict=True)):
            _draw_row(axes, row, looks)
            axes.broken_barh(_lit(sensor.lamp), (row + 0.37, 0.07), color=LAMP, linewidth=0)
        for act in evening.acts:
            _draw_act(axes, act)
        _legend(axes)
        axes.set(
            title="An evening in virtual time: firmware compiled, box real, an attacker throughout",
            xlabel="s",
            xlim=(0.0, evening.end),
            ylim=(len(NAMES) - 0.3, -1.15),
        )
        axes.set_yticks(range(len(NAMES)), NAMES)
        axes.tick_params(axis="y", length=0)
        axes.spines[["top", "right", "left"]].set_visible(False)
        figure.savefig(path, dpi=110)
        pyplot.close(figure)


def _draw_row(axes: Any, row: int, looks: list[Look]) -> None:
    """A band in the state's colour, with the rate of accepted readings in it."""
    at = np.array([one.at for one in looks])
    for state, (_, colour) in STATES.items():
        spans = [(one.at - LOOK_S, LOOK_S) for one in looks if one.state == state]
        axes.broken_barh(spans, (row - 0.25, 0.6), color=colour, linewidth=0)
    rate = np.convolve([one.accepted / LOOK_S for one in looks], np.full(SMOOTHED, 1 / SMOOTHED), "same")
    top = row + 0.35 - 0.6 * np.minimum(rate / FULL_RATE_HZ, 1.0)
    axes.plot(at, top, color=IVORY, linewidth=0.9)


def _lit(lamp: list[tuple[float, bool]]) -> list[tuple[float, float]]:
    """When the lamp was on: starts and lengths; a flash is drawn long enough to be seen."""
    return [
        (on - EPOCH_S, max(off - on, SHORTEST_DRAWN_S)) for (on, is_on), (off, _) in pairwise(lamp) if is_on
    ]


def _draw_act(axes: Any, act: Act) -> None:
    if act.sensor is None:
        axes.axvline(act.at, color=VERMILION, linewidth=1.2)
        if act.label != "end":
            side = "right" if act.label.endswith("off") else "left"
            axes.text(act.at + (0.4 if side == "left" else -0.4), -0.75, act.label, color=VERMILION, ha=side)
        return
    mark = "|" if act.label == "power on" else "v"
    axes.plot([act.at], [act.sensor - 0.42], mark, color=VERMILION, markersize=6, clip_on=False)
    if act.label != "power on":
        axes.text(act.at + 0.5, act.sensor - 0.43, act.label, color=IVORY, fontsize=8, va="center")


def _legend(axes: Any) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = [Patch(color=colour, label=text) for text, colour in STATES.values()]
    entries.append(Line2D([], [], color=IVORY, linewidth=0.9, label="accepted readings (top: 50 a second)"))
    entries.append(Line2D([], [], color=LAMP, linewidth=4, label="lamp"))
    entries.append(Line2D([], [], color=VERMILION, marker="v", linestyle="", label="fault"))
    axes.legend(handles=entries, loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=7, frameon=False)
