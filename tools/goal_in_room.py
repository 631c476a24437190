"""Measures the goal in the room: `python -m tools.goal_in_room [SECONDS]`, for each of two goals 20 s.

Rows: the root's distance from the goal after 8 s, at each moment and as a mean over two seconds (a step sways
forth and back), and how fast the feet that carry the figure slide. Null product: the same dance without a
goal; and beside it the phrase itself.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from appliance.pose.quaternion import Array
from tools.offline_stage import OfflineStage, changed_show

GOALS = ((1.0, 0.5), (-0.8, -0.6))
GOAL_S, SETTLED_S, SWAY_S = 20.0, 8.0, 2.0
SUPPORT_M, FPS = 0.02, 50


def slide_cm_s(soles: Array) -> float:
    """Mean speed of the lowest points of the soles (T, S, 3) over the floor, in centimetres a second."""
    heights = soles[:-1, :, 1]
    carries = heights < heights.min(axis=1, keepdims=True) + SUPPORT_M
    speeds = np.linalg.norm(np.diff(soles[..., [0, 2]], axis=0), axis=-1) * FPS
    return float(100.0 * (speeds * carries).sum() / carries.sum())


def danced(bundle: Path, goals: tuple[tuple[float, float], ...], seconds: float) -> tuple[Array, Array]:
    """Roots (G, T, 2) and soles (G, T, S, 3) while each of the goals is set; no goals: of the phrase."""
    stage = OfflineStage(bundle)
    led = stage.parts.puppets[-1]
    for _ in range(200):
        stage.dance()
    roots, soles = [], []
    for goal in goals or ((),) * len(GOALS):
        if goal:
            stage.order("goal", *goal)
        way, feet = [], []
        for _ in range(round(seconds * FPS)):
            stage.dance()
            way.append(led.frame.root[[0, 2]].copy())
            feet.append(led.grounding.figure.soles.copy())
        roots.append(way)
        soles.append(feet)
    return np.array(roots, float), np.array(soles, float)


def row(name: str, roots: Array, soles: Array) -> str:
    """A row of the table."""
    settled = roots[:, round(SETTLED_S * FPS) :] - np.array(GOALS)[:, None]
    off = 100 * np.linalg.norm(settled, axis=-1)
    sway = round(SWAY_S * FPS)
    means = np.lib.stride_tricks.sliding_window_view(settled, sway, axis=1).mean(axis=-1)
    middle = 100 * np.linalg.norm(means, axis=-1)
    slide = np.mean([slide_cm_s(one) for one in soles])
    each = ", ".join(f"{one:.0f}" for one in np.median(off, axis=1))
    figures = f"{np.median(off):.1f} ({each}) | {np.percentile(off, 95):.1f}"
    return f"| {name} | {figures} | {np.percentile(middle, 95):.1f} | {slide:.1f} |"


def main() -> None:
    """Print the table."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else GOAL_S
    print("| | off the goal, cm: median (each) | 95 % | its mean over 2 s, 95 % | feet slide, cm/s |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        show = changed_show(
            Path(scratch) / "show", {"motion": {"goes_on": {}}, "puppets": [{"name": "a", "x": 0.0}]}
        )
        print(row("goal", *danced(show, GOALS, seconds)))
        print(row("phrase, no goal", *danced(show, (), seconds)))


if __name__ == "__main__":
    main()
