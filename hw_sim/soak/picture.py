"""The picture of a soak: lateness of the box and of the machine, and memory, second by second."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hw_sim.report import IVORY, LOOK, SLATE, VERMILION
from hw_sim.soak.box import LATE_MS
from hw_sim.soak.run import Soak
from hw_sim.soak.vitals import Vitals

_SHADES = {"processor": "#3a2a2a", "memory": "#2a3a2a", "disk": "#2a2f44", "all": "#43283a"}
_LINES = (VERMILION, IVORY, "#7fb5a8", "#c9a24b", "#8f7fd0", SLATE)


def draw_soak(path: Path, soak: Soak) -> Path:
    """Write the PNG. Needs matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with matplotlib.rc_context(LOOK):
        figure, axes = pyplot.subplots(
            3, 1, figsize=(12, 11), layout="constrained", sharex=True, height_ratios=(3, 3, 2)
        )
        _lateness(axes[0], soak)
        _memory(axes[1], soak)
        _handles(axes[2], soak)
        for one in axes:
            one.spines[["top", "right"]].set_visible(False)
            _shade_loads(one, soak)
        axes[2].set_xlabel("minutes; coloured: load (red processor, green memory, blue disk, purple all)")
        figure.savefig(path, dpi=110)
        pyplot.close(figure)
    return path


def _lateness(axes: Any, soak: Soak) -> None:
    of_machine, of_box = soak.wakeups.seconds.worst_ms, soak.frames.seconds.worst_ms
    for worst, colour, name in ((of_machine, SLATE, "cyclictest"), (of_box, VERMILION, "frame")):
        axes.plot(
            [second / 60.0 for second in worst],
            [max(delay_ms, 0.01) for delay_ms in worst.values()],
            *(".",),
            color=colour,
            markersize=2.5,
            label=f"{name}: worst of each second",
        )
    axes.axhline(LATE_MS, color=IVORY, linewidth=0.6)
    axes.set_title(f"How late (line: {LATE_MS:g} ms, from there on a frame counts as late)", loc="left")
    axes.set_ylabel("ms")
    axes.set_yscale("log")
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, markerscale=3)


def _memory(axes: Any, soak: Soak) -> None:
    _draw_units(axes, soak, lambda held: held.rss_mb)
    axes.set_title("Resident memory", loc="left")
    axes.set(ylabel="MB", ylim=(0.0, None))
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(soak.box.units))


def _handles(axes: Any, soak: Soak) -> None:
    _draw_units(axes, soak, lambda held: held.handles)
    axes.set_title("Open handles", loc="left")
    axes.set_ylim(0.0)


def _draw_units(axes: Any, soak: Soak, value: Callable[[Vitals], float]) -> None:
    """A line for each process, over the minutes in which it lived."""
    for number, unit in enumerate(soak.box.units):
        seen = [
            (look.at / 60.0, value(look.held[unit.name])) for look in soak.looks if unit.name in look.held
        ]
        if seen:
            axes.plot(*zip(*seen, strict=True), color=_LINES[number % len(_LINES)], label=unit.name)


def _shade_loads(axes: Any, soak: Soak) -> None:
    since, load = 0.0, "none"
    for look in [*soak.looks, None]:
        name, at = (look.load, look.at / 60.0) if look is not None else ("", soak.seconds / 60.0)
        if name != load:
            if load in _SHADES:
                axes.axvspan(since, at, color=_SHADES[load], linewidth=0, zorder=0)
            since, load = at, name
