"""Lights that follow what moves: quantity of motion and efforts."""

from __future__ import annotations

import pytest

from appliance.levers.show_state import ShowState
from tests.lights.rigs import PERIOD_S, frame, lights, rig
from tests.lights.test_mapping import DIMMER, PAR, levels, still

WALK = [(1.0 * PERIOD_S * step, 1.0, 0.0) for step in range(60)]  # 1 m/s; of the two joints one moves


@pytest.mark.parametrize(
    ("reads", "ends", "wanted"),
    [
        ("qom", [0, 1], 0.5),  # m/s, mean of two joints
        ("weight_effort", [0, 1], 0.5),  # (m/s)^2
        ("space_effort", [0, 2], 0.5),  # a straight way: 1
        ("time_effort", [0, 1], 0.0),  # even speed
        ("flow_effort", [0, 100], 0.0),
    ],
)
def test_what_moves_drives_a_dimmer(reads: str, ends: list[float], wanted: float) -> None:
    made = rig(lights([PAR], {"reads": reads, "drives": "dimmer", "range": ends}))
    shown = levels(made, *WALK)
    assert shown[-1][DIMMER] == pytest.approx(255 * wanted, abs=4)
    last = frame(60, WALK[-1])
    for step in range(30):  # a stage that hangs moves no more
        after = made.render(last, 1, ShowState(), last.frame_time + 0.025 * step)
    assert after[1][DIMMER] < 5


@pytest.mark.parametrize("reads", ["qom", "weight_effort", "time_effort", "flow_effort"])
def test_a_jump_of_the_phrase_is_no_effort(reads: str) -> None:
    made = rig(lights([PAR], {"reads": reads, "drives": "dimmer"}))
    levels(made, *[(0, 1, 0)] * 30)
    assert still(made, (5, 1, 0), first=31)[DIMMER] < 5
    assert max(shown[DIMMER] for shown in levels(made, *[(5, 1, 0)] * 30, first=32)) < 5
