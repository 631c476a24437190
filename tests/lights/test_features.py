"""Lights that follow what moves: quantity of motion and efforts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.levers.show_state import ShowState
from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.features import Features
from appliance.show.config_error import ConfigError
from appliance.show.light_rules import RuleConfig
from appliance.show.show import load_show
from hw_sim.osc_receiver import decode
from tests.bundles import write_show
from tests.lights.rigs import PERIOD_S, SKELETON, frame, lights, rig
from tests.lights.test_mapping import DIMMER, OTHER, PAR, levels, still

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


def turning(tick: int, radians_s: float) -> list[float]:
    half = 0.5 * radians_s * PERIOD_S * tick
    return [math.cos(half), 0.0, math.sin(half), 0.0]


def with_movers(
    tick: int, turns: Sequence[float] = (), live: Sequence[float] | None = None, late: bool = False
) -> JointFrame:
    """A frame whose puppet stands still, with hands that have turned and a live dancer's two joints."""
    hands = np.array([turning(tick, one) for one in turns], np.float32).reshape(-1, 4)
    joints = np.zeros((2, 3), np.float32) if live is None else np.array([[0, 1, 0.5], live], np.float32)
    return replace(frame(tick, late=late), hands=hands, live=joints)


def of_hands(*rules: Mapping[str, Any], puppets: Sequence[str] = ("left", "right")) -> Rig:
    """A rig of a show with two puppets; the first has hands on both joints, the second one on its hand."""
    config = lights([PAR, OTHER], *rules)
    hands = [("left", "hip"), ("left", "hand"), ("right", "hand")]
    made = Rig(config, Patch(config.fixtures, None), SKELETON, puppets=puppets, led="left", hands=hands)
    made.safety = 0.0
    return made


def test_a_rule_reads_the_hand_that_it_names_and_no_other() -> None:
    rule = {"reads": "qom", "of": "hand", "drives": "dimmer", "range": [0, 4]}
    asked = [{}, {"joint": "hand"}, {"joint": "hand", "puppet": "right"}]
    for place, names in enumerate(asked):
        made = of_hands(rule | names)
        for tick in range(60):
            turns = [2.0 if place == number else 0.2 for number in range(3)]
            seen = with_movers(tick, turns)
            shown = made.render(seen, 1, ShowState(), seen.frame_time)[1]
        assert shown[DIMMER] == pytest.approx(255 * 2.0 / 4.0, abs=3), names
        for step in range(60):  # a stage that hangs: the hand rests
            shown = made.render(seen, 1, ShowState(), seen.frame_time + 0.025 * step)[1]
        assert shown[DIMMER] < 5


def test_hand_and_live_dancer_have_the_numbers_that_receivers_get() -> None:
    """Of steady motion, which smoothing leaves as it is; the puppet itself stands still."""
    rules = [
        RuleConfig.model_validate({"reads": name, "of": of, "drives": "dimmer"})
        for of in ("hand", "live")
        for name in ("qom", "weight_effort", "space_effort")
    ]
    made, features = (
        of_hands(*map(RuleConfig.model_dump, rules)),
        Features(SKELETON, None, {0: "hip"}, 0, True),
    )
    for tick in range(80):
        seen = with_movers(tick, [2.0, 0.0, 0.0], [1.5 * PERIOD_S * tick, 1.0, 0.0])
        made.render(seen, 1, ShowState(), seen.frame_time)
        packets = features.encode(seen, seen.puppets[0])
    reported = dict(message for packet in packets for message in decode(bytes(packet)))
    where = {"hand": "/bunraku/hand/hip", "live": "/bunraku/live"}
    found = [made.dances.read(rule) for rule in rules]
    assert found == pytest.approx(
        [reported[f"{where[str(rule.of)]}/{rule.reads}"][0] for rule in rules], rel=0.01
    )
    assert found[0] == pytest.approx(2.0, rel=0.01) and found[3] == pytest.approx(0.75, rel=0.01)
    assert made.dances.of("left").body_speed < 0.01


def test_a_live_dancer_drives_lamps_and_one_who_is_gone_lets_them_rest() -> None:
    speed = {"reads": "speed", "of": "live", "joint": "hand", "drives": "dimmer", "fixtures": ["par"]}
    height = {"reads": "height", "of": "live", "joint": "hand", "drives": "dimmer", "fixtures": ["other"]}
    made = of_hands(speed | {"range": [0, 2]}, height)
    for tick in range(120):
        live = [1.0 * PERIOD_S * tick, 1.5, 0.0] if tick < 60 else None
        seen = with_movers(tick, live=live)
        shown = made.render(seen, 1, ShowState(), seen.frame_time)[1]
        if tick == 59:
            assert shown[DIMMER] == pytest.approx(128, abs=4) and shown[10] == pytest.approx(191, abs=2)
    assert shown[DIMMER] < 5


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ({"reads": "height", "of": "hand"}, "'height' cannot be read of 'hand'"),
        ({"reads": "lean", "of": "live"}, "'lean' cannot be read of 'live'"),
        ({"reads": "qom", "of": "live", "puppet": "left"}, "A live dancer is no puppet"),
        ({"reads": "qom", "of": "live"}, "This show takes no live dancer"),
        ({"reads": "qom", "of": "hand", "joint": "rFoot"}, "No hand holds rFoot"),
        ({"reads": "qom", "of": "hand"}, None),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path: Path, rule: dict[str, Any], said: str | None) -> None:
    rig_of_show = {"fixtures": [PAR], "mappings": [{"name": "first", "rules": [rule | {"drives": "dimmer"}]}]}
    written = write_show(
        tmp_path / "show", lights=rig_of_show, hands=[{"sensor": "wrist", "joint": "lForeArm"}]
    )
    if said is None:
        assert load_show(written).config.lights.mappings[0].rules[0].ends == (0.0, 7.0)
        return
    with pytest.raises(ConfigError, match=said):
        load_show(written)
