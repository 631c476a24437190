"""The picture of a measurement: how long readings were on their way, and how soon they were used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hw_sim.figures import POWER_ON_AND_JOIN_S, POWER_ON_S, RESTART_S, Evidence
from hw_sim.latency import Transport
from hw_sim.probe import Run

IVORY, VERMILION, SLATE, BACKDROP = "#efe6d8", "#f5452a", "#8f9bb3", "#14151b"
LOOK: Any = {
    "figure.facecolor": BACKDROP,
    "axes.facecolor": BACKDROP,
    "text.color": IVORY,
    "axes.labelcolor": IVORY,
    "axes.edgecolor": SLATE,
    "xtick.color": SLATE,
    "ytick.color": SLATE,
    "font.size": 10,
}
LONGEST_SHOWN_MS = 45.0


def draw_report(path: Path, evidence: Evidence) -> Path:
    """Write the PNG. Needs matplotlib."""
    import matplotlib
    from matplotlib.figure import Figure

    way, free = evidence.transports
    with matplotlib.rc_context(LOOK):
        figure = Figure(figsize=(11, 14), layout="constrained")
        axes = figure.subplots(4, 1)
        _histogram(axes[0], way, free)
        _timeline(axes[1], way)
        _sections(axes[2], evidence.locked)
        _first_readings(axes[3], evidence)
        for one in axes:
            one.spines[["top", "right"]].set_visible(False)
        figure.savefig(path, dpi=110)
    return path


def _histogram(axes: Any, way: Transport, free: Transport) -> None:
    edges = np.arange(0.0, LONGEST_SHOWN_MS, 0.5)
    for one, colour, name in ((free, SLATE, "running free"), (way, VERMILION, "in phase with the sensor")):
        if len(one.latency_ms):
            share = np.full(len(one.latency_ms), 100.0 / len(one.latency_ms))
            shown = np.minimum(one.latency_ms, edges[-1] - 0.01)
            median = np.median(one.latency_ms)
            axes.hist(
                shown, edges, weights=share, color=colour, alpha=0.85, label=f"{name}: median {median:.2f} ms"
            )
    axes.set(title="Datagram in to datagram out", xlabel="ms (the last bar: longer)", ylabel="% of readings")
    axes.legend(frameon=False)


def _timeline(axes: Any, way: Transport) -> None:
    if len(way.sent_at):
        axes.plot(way.sent_at - way.sent_at[0], way.latency_ms, ".", color=VERMILION, markersize=3)
    axes.set(title="In phase, reading by reading", xlabel="s", ylabel="ms", ylim=(0.0, LONGEST_SHOWN_MS))


def _sections(axes: Any, locked: Run) -> None:
    parts = locked.ticks["sections_ms"]
    median, p99 = np.median(parts, axis=0), np.percentile(parts, 99, axis=0)
    place = np.arange(len(locked.sections))
    axes.bar(place, p99, color=SLATE, label="p99")
    axes.bar(place, median, color=VERMILION, label="median")
    axes.set_xticks(place, locked.sections)
    axes.set(title=f"A tick by section ({len(parts)} ticks)", ylabel="ms")
    axes.legend(frameon=False)


def _first_readings(axes: Any, evidence: Evidence) -> None:
    """Each power-on and each restart as a dot, their limits as lines."""
    rows = (
        (
            "sensor switched on",
            evidence.power_on_s,
            POWER_ON_AND_JOIN_S if evidence.firmware else POWER_ON_S,
        ),
        ("box restarted", evidence.restart_s, RESTART_S),
        ("box killed", evidence.kill_s, RESTART_S),
    )
    for place, (_, seconds, limit) in enumerate(rows):
        axes.plot(seconds, [place] * len(seconds), "o", color=VERMILION, alpha=0.6)
        axes.plot([limit, limit], [place - 0.4, place + 0.4], color=SLATE)
    axes.set_yticks(range(len(rows)), [text for text, *_ in rows])
    axes.set(title="Until a frame carries a reading (line: the limit)", xlabel="s", ylim=(-0.6, 2.6))
    axes.set_xlim(left=0.0)
    axes.invert_yaxis()
