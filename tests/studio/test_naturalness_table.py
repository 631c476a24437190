"""The table that every generated dance is held to, with the recordings' own figures in its last row."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rich.console import Console

from appliance.studio.data.dataset import Take
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import UNDER, naturalness_table
from tests.studio.tiny import moving, swaying


def cells(line: str) -> list[str]:
    return [cell for cell in line.split("  ") if cell.strip()]


def test_a_row_for_each_dance_and_the_recordings_last() -> None:
    recorded = [swaying(4.0, seed) for seed in (0, 1)]
    takes = [Take(f"{n}", f"{n}", one, one.poses[:, 0, 0] < 2, 50, 50) for n, one in enumerate(recorded)]
    yardstick = Yardstick.of(takes, moving())
    floating = recorded[0].roots.copy()
    floating[:100, 1] += 0.04  # too little for a jump
    made = {
        "as_recorded": measure(recorded[0], yardstick),
        "floating": measure(replace(recorded[0], roots=floating), yardstick, endless=False),
    }
    console = Console(width=80)
    with console.capture() as captured:
        console.print(naturalness_table(made))
    _, head, *rows = (line for line in captured.get().splitlines()[1:] if line.strip(" ─"))
    assert [cell.strip() for cell in cells(head)] == list(UNDER)
    assert [row.strip().split("  ")[0] for row in rows] == ["as recorded", "floating", "recordings"]
    as_recorded, above, own = (cells(row)[1:] for row in rows)
    assert float(as_recorded[2]) == pytest.approx(1, abs=0.3)
    lifted, usual = (float(row[6]) for row in (above, own))
    assert lifted > usual + 1
    assert len(as_recorded) == len(UNDER) and len(above) == len(own) == len(UNDER) - 1, "a seam is a loop's"
