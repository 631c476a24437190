"""Measures the tick of a partner: `python -m tools.partner_cost [SECONDS]`.

Two puppets of the default show dance in one process: without a partner (the null), and with one at values of
`follow`, tick by tick in turn. A choice takes three ticks of sixteen, which are those of the 99 %.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from appliance.box.clock import TICK_S
from tools.offline_stage import OfflineStage, changed_show

FOLLOWS = (None, 0.0, 0.5, 0.75, 1.0)
ITERATIONS = 10, 9
BEGINS = 100  # ticks until the partner goes on by itself


def main() -> None:
    """Print the table."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    with tempfile.TemporaryDirectory() as scratch:
        stages = {}
        for place, follow in enumerate(FOLLOWS):
            partner = {} if follow is None else {"partner": "a", "follow": follow}
            puppets = [{"name": "a", "x": -0.9}, {"name": "b", "x": 0.9} | partner]
            show = changed_show(Path(scratch) / str(place), {"motion": {"improvise": {}}, "puppets": puppets})
            stages[follow] = OfflineStage(show, ITERATIONS)
        spent: dict[float | None, list[float]] = {follow: [] for follow in FOLLOWS}
        for tick in range(BEGINS + round(seconds / TICK_S)):
            for follow, stage in stages.items():  # in turn, so that a busy machine is as busy for each
                began = time.process_time()
                stage.dance()
                if tick >= BEGINS:
                    spent[follow].append(1000 * (time.process_time() - began))
    print("| partner | tick, ms of processor time: mean | median | 99 % | mean, of the tick without |")
    print("|---|---|---|---|---|")
    for follow, times in spent.items():
        name = "none" if follow is None else f"follow {follow:g}"
        mean, (middle, most) = np.mean(times), np.percentile(times, (50, 99))
        print(f"| {name} | {mean:.2f} | {middle:.2f} | {most:.2f} | {mean / np.mean(spent[None]):.2f} |")


if __name__ == "__main__":
    main()
