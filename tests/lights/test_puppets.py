"""Lights that follow one of several puppets."""

from __future__ import annotations

from appliance.levers.show_state import ShowState
from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from tests.lights.rigs import SKELETON, frame, lights
from tests.outputs.small_stage import together

PAR = {"name": "par", "profile": "led-par", "address": 1}
OTHER = {"name": "other", "profile": "led-par", "address": 11}
HEAD = {"name": "head", "profile": "moving-wash", "address": 21, "place": [0, 4, 0]}
DIMMER, OTHER_DIMMER = 0, 10  # channels, from 0


def test_a_rule_reads_the_joints_of_its_puppet() -> None:
    height = {"reads": "height", "joint": "hand", "drives": "dimmer"}
    config = lights(
        [PAR, OTHER, HEAD],
        height | {"fixtures": ["par"]},
        height | {"fixtures": ["other"], "puppet": "right"},
        {"reads": "place", "joint": "hand", "drives": "aim", "puppet": "right"},
    )
    made = Rig(config, Patch(config.fixtures, None), SKELETON, puppets=("left", "right"), led="left")
    made.safety = 0.0
    for tick in range(1, 4):
        seen = together(frame(tick, (0.0, 0.5, 0.0)), frame(tick, (1.0, 1.5, 0.0)))
        shown = made.render(seen, 1, ShowState(), seen.frame_time)[1]
    assert (shown[DIMMER], shown[OTHER_DIMMER]) == (64, 191)
    assert made.dances.of("right").place("hand").tolist() == [1.0, 1.5, 0.0]
    for tick in range(4, 8):  # its own speed, too
        seen = together(frame(tick, (0.0, 0.5, 0.0)), frame(tick, (1.0 + 0.1 * tick, 1.5, 0.0)))
        made.render(seen, 1, ShowState(), seen.frame_time)
    assert made.dances.of("right").body_speed > 1.0 > 0.01 > made.dances.of(None).body_speed


def test_a_head_aims_at_its_puppet() -> None:
    aims = []
    for puppet in (None, "right"):
        rule = {"reads": "place", "joint": "hand", "drives": "aim", "puppet": puppet}
        config = lights([HEAD], rule)
        made = Rig(config, Patch(config.fixtures, None), SKELETON, puppets=("left", "right"), led="left")
        made.safety = 0.0
        for tick in range(1, 400):
            seen = together(frame(tick, (-1.5, 1.0, 0.0)), frame(tick, (1.5, 1.0, 0.0)))
            shown = made.render(seen, 1, ShowState(), seen.frame_time)[1]
        aims.append(shown[20:26])
    assert aims[0] != aims[1]
