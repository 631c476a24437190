"""Measures the personal space of two puppets: `python -m tools.apart [MINUTES]`.

Both dance the default show's phrase, the second one 40 s later in it and from nearly the same place.
A row each without personal space, with it, and the null product: no space, but one of them set aside by as
much.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from appliance.pose.quaternion import Array
from tools.goal_in_room import slide_cm_s
from tools.offline_stage import OfflineStage, changed_show

MINUTES, FPS, SPACE_M = 10.0, 50, 0.3


def danced(bundle: Path, minutes: float) -> tuple[Array, list[Array]]:
    """Roots (2, T, 2) on the stage, metres, and the soles of each puppet (T, S, 3)."""
    stage = OfflineStage(bundle, (1, 0))
    puppets = stage.parts.puppets
    roots, soles = [], []
    for _ in range(round(minutes * 60 * FPS)):
        stage.dance()
        roots.append([one.frame.root[[0, 2]].copy() for one in puppets])
        soles.append([one.grounding.figure.soles.copy() for one in puppets])
    feet = np.array(soles, float)
    return np.array(roots, float).swapaxes(0, 1), [feet[:, number] for number in range(len(puppets))]


def row(name: str, roots: Array, soles: list[Array]) -> str:
    """A row of the table."""
    apart = np.linalg.norm(roots[0] - roots[1], axis=-1)
    speeds = np.linalg.norm(np.diff(roots, axis=1), axis=-1) * FPS
    near = 100 * np.mean(apart < 2 * SPACE_M)
    slide = np.mean([slide_cm_s(one) for one in soles])
    figures = f"{apart.min():.2f} | {np.percentile(apart, 1):.2f} | {near:.1f} | {speeds.max():.1f}"
    return f"| {name} | {figures} | {slide:.1f} |"


def main() -> None:
    """Print the table."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else MINUTES
    print(
        "| | nearest, m | 1 %, m | nearer than 0.6 m, % of the time | fastest root, m/s | feet slide, cm/s |"
    )
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for name, space, aside in (
            ("without", 0.0, 0.0),
            ("with", SPACE_M, 0.0),
            ("null: set aside by 0.6 m", 0.0, 2 * SPACE_M),
        ):
            pair = [
                {"name": "a", "x": 0.0, "space": space},
                {"name": "b", "x": aside, "z": 0.3, "start_s": 40.0, "space": space},
            ]
            bundle = changed_show(Path(scratch) / f"{space}_{aside}", {"puppets": pair})
            print(row(name, *danced(bundle, minutes)), flush=True)


if __name__ == "__main__":
    main()
