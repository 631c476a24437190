"""docs/pictures/lamp.png, by `python -m tools.lamp_picture`: what the sensor's lamp shows and means.

Every row is a trace of the compiled firmware in its simulated world, not of a table beside it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.lamp_traces import SHOWN_S, Trace, traces

PICTURE = Path("docs/pictures/lamp.png")
WIDTH, ROW, TOP, HEADING = 1280, 74, 84, 58
STRIP_X, STRIP, TEXT_X = 248, 440, 742
BACKDROP, INK, FAINT, GROOVE, LIT = "#0f1015", "#efe6d8", "#9a948c", "#262932", "#ffd27a"


@dataclass(frozen=True)
class Row:
    """One thing that the lamp shows: the trace's name, how people call it, what it means, what to do."""

    trace: str
    rhythm: str
    meaning: str
    advice: str


GROUPS: tuple[tuple[str, tuple[Row, ...]], ...] = (
    (
        "Every evening, from top to bottom",
        (
            Row(
                "joining",
                "flickers, stays lit",
                "It looks for the network.",
                "Longer than a minute: is the Wi-Fi on?",
            ),
            Row(
                "neutral", "blinks slowly", "Stand still.", "Arms hanging, face to the front, until it stops."
            ),
            Row("linked", "one short flash", "Dance.", "Every 3 seconds: hardly visible from the seats."),
        ),
    ),
    (
        "Now and then",
        (
            Row(
                "battery",
                "three short flashes",
                "The battery is low.",
                "It dances on. Charge it after the show.",
            ),
            Row("strobe", "flickers on and on", "Someone looks for this sensor.", "Hold it up."),
        ),
    ),
    (
        "For the technician",
        (
            Row("unprovisioned", "two short flashes", "It knows no box yet.", "By cable: bunraku provision."),
            Row(
                "no imu",
                "five short flashes",
                "It feels no movement.",
                "Off and on again; else take the spare.",
            ),
        ),
    ),
)


def main() -> None:
    """Draw the picture, or another file that is named."""
    print(draw_lamp(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE, traces()))


def draw_lamp(path: Path, shown: dict[str, Trace]) -> Path:
    """All rows; `shown`: by name, when the lamp went on and off, seconds in 0..SHOWN_S. Needs matplotlib."""
    from matplotlib.figure import Figure

    height = TOP + sum(HEADING + ROW * len(rows) for _, rows in GROUPS) + 24
    figure = Figure(figsize=(WIDTH / 100, height / 100), dpi=100, facecolor=BACKDROP)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(height, 0)
    axes.text(48, 46, "The lamp's signals", color=INK, fontsize=20, va="center")
    seconds = f"{SHOWN_S:g} seconds, from left to right"
    axes.text(STRIP_X + STRIP, 50, seconds, color=FAINT, fontsize=10, ha="right", va="center")
    y = float(TOP)
    for heading, rows in GROUPS:
        axes.text(48, y + 26, heading, color=FAINT, fontsize=11.5, va="center")
        axes.plot([48, WIDTH - 48], [y + 44, y + 44], color=GROOVE, linewidth=1)
        for number, row in enumerate(rows):
            _draw_row(axes, row, shown[row.trace], y + HEADING + ROW * (number + 0.5))
        y += HEADING + ROW * len(rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, facecolor=BACKDROP)
    return path


def _draw_row(axes: Any, row: Row, trace: Trace, y: float) -> None:
    axes.text(48, y, row.rhythm, color=INK, fontsize=12.5, va="center")
    axes.add_patch(_bar(0.0, SHOWN_S, y, 5.0, GROOVE, 1.0))
    for thickness, alpha in ((39.0, 0.03), (33.0, 0.04), (27.0, 0.06), (21.0, 0.10), (15.0, 1.0)):
        for begun, ended in trace:
            axes.add_patch(_bar(begun, ended, y, thickness, LIT, alpha))
    axes.text(TEXT_X, y - 11, row.meaning, color=INK, fontsize=14, va="center", weight="bold")
    axes.text(TEXT_X, y + 14, row.advice, color=FAINT, fontsize=11.5, va="center")


def _bar(begun: float, ended: float, y: float, thickness: float, colour: str, alpha: float) -> Any:
    from matplotlib.patches import FancyBboxPatch

    left, right = (STRIP_X + STRIP * t / SHOWN_S for t in (begun, ended))
    wider = (thickness - 15.0) / 4 if colour == LIT else 0.0
    round_by = f"round,pad=0,rounding_size={min(thickness / 2, (right - left) / 2 + wider):.2f}"
    corner, width = (left - wider, y - thickness / 2), right - left + 2 * wider
    return FancyBboxPatch(
        corner, width, thickness, boxstyle=round_by, facecolor=colour, alpha=alpha, edgecolor="none"
    )


if __name__ == "__main__":
    main()
