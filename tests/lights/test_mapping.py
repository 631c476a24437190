"""Mappings: what the dance does, the lights show, in the shape and at the speed that the rule says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.levers.show_state import ShowState
from appliance.levers.table import LIGHTS
from appliance.lights.dance import lean, turn
from appliance.lights.mapping import bent, eased, share
from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from appliance.pose import quaternion
from appliance.show.light_rules import RuleConfig
from appliance.show.lights import LightsConfig
from tests.lights.rigs import PERIOD_S, SKELETON, frame, lights, rig

PAR = {"name": "par", "profile": "led-par", "address": 1}
OTHER = {"name": "other", "profile": "led-par", "address": 11}
HEAD = {"name": "head", "profile": "moving-wash", "address": 21, "place": [0, 4, 0]}
DIMMER, RED, GREEN, BLUE = 0, 1, 2, 3  # channels of PAR, from 0
AT_ONCE = {"attack_s": 0, "release_s": 0}


def levels(
    made: Rig, *hands: Any, show_state: ShowState | None = None, first: int = 1, **changes: Any
) -> list[bytes]:
    """Universe 1 after each frame, the hand being at each of these places, 20 ms apart."""
    shown = []
    for tick, hand in enumerate(hands, first):
        seen = frame(tick, hand, **changes)
        shown.append(made.render(seen, 1, show_state or ShowState(), seen.frame_time)[1])
    return shown


def still(made: Rig, hand: Any = (0.0, 1.0, 0.0), count: int = 1, **changes: Any) -> bytes:
    return levels(made, *[hand] * count, **changes)[-1]


@pytest.mark.parametrize(
    ("reads", "hand", "wanted"),
    [
        ("height", (0, 0.5, 0), 64),
        ("height", (0, 3.0, 0), 255),
        ("height", (0, -1.0, 0), 0),
        ("across", (1, 1, 0), 191),  # of -2 to 2 metres
        ("depth", (0, 1, -1), 64),
    ],
)
def test_places_drive_an_attribute(reads: str, hand: Any, wanted: int) -> None:
    made = rig(lights([PAR], {"reads": reads, "joint": "hand", "drives": "dimmer"}))
    assert still(made, hand)[DIMMER] == wanted


def test_ranges_and_outputs_scale_and_turn_round() -> None:
    rule = {"reads": "height", "joint": "hand", "drives": "dimmer", "range": [2, 1], "output": [0.2, 0.6]}
    made = rig(lights([PAR], rule | AT_ONCE))
    assert still(made, (0, 1.0, 0))[DIMMER] == 153
    assert still(made, (0, 2.0, 0), first=2)[DIMMER] == 51


def test_speed_drives_the_dimmer_and_one_late_frame_is_no_step() -> None:
    made = rig(lights([PAR], {"reads": "speed", "joint": "hand", "drives": "dimmer", "range": [0, 1]}))
    path = [(0.5 * PERIOD_S * step, 1.0, 0.0) for step in range(60)]
    assert levels(made, *path)[-1][DIMMER] == pytest.approx(128, abs=2)
    late = frame(61, path[-1], late=True)
    assert made.render(late, 1, ShowState(), late.frame_time)[1][DIMMER] == pytest.approx(128, abs=2)
    after = frame(62, (0.5 * PERIOD_S * 61, 1.0, 0.0))
    assert made.render(after, 1, ShowState(), after.frame_time)[1][DIMMER] == pytest.approx(128, abs=6)


def test_a_jump_of_the_phrase_is_no_speed_that_a_dancer_could_have() -> None:
    made = rig(lights([PAR], {"reads": "speed", "joint": "hand", "drives": "dimmer", "range": [0, 100]}))
    levels(made, (0, 1, 0), (0, 1, 0))
    assert still(made, (500, 1, 0), first=3)[DIMMER] <= 0.15 * 255 + 1


def test_a_stage_that_hangs_moves_no_more() -> None:
    rule = {"reads": "speed", "joint": "hand", "drives": "dimmer", "range": [0, 1]}
    made = rig(lights([PAR], rule | AT_ONCE))
    path = [(1.0 * PERIOD_S * step, 1.0, 0.0) for step in range(60)]
    assert levels(made, *path)[-1][DIMMER] > 250
    last = frame(60, path[-1])
    for step in range(30):
        shown = made.render(last, 1, ShowState(), last.frame_time + 0.025 * step)
    assert shown[1][DIMMER] < 5


def test_without_a_joint_speed_is_that_of_the_whole_body() -> None:
    made = rig(lights([PAR], {"reads": "speed", "drives": "dimmer", "range": [0, 1]}))
    path = [(1.0 * PERIOD_S * step, 1.0, 0.0) for step in range(60)]
    assert levels(made, *path)[-1][DIMMER] == pytest.approx(128, abs=2)  # the hip stands still


def test_attack_and_release_take_the_seconds_that_they_say() -> None:
    rule = {"reads": "height", "joint": "hand", "drives": "dimmer", "attack_s": 0.2, "release_s": 1.0}
    made = rig(lights([PAR], rule))
    still(made, (0, 0, 0))
    rise = [shown[DIMMER] / 255 for shown in levels(made, *[(0, 2, 0)] * 15, first=2)]
    assert rise[4] == pytest.approx(0.5, abs=0.01)
    assert rise[9] == pytest.approx(1.0, abs=0.01)
    fall = [shown[DIMMER] / 255 for shown in levels(made, *[(0, 0, 0)] * 60, first=17)]
    assert fall[24] == pytest.approx(0.5, abs=0.01)
    assert fall[-1] == 0.0


def test_height_drives_colour_through_the_colours_of_the_rule() -> None:
    colours = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    rule = {"reads": "height", "joint": "hand", "drives": "colour", "colours": colours}
    made = rig(lights([PAR], rule | AT_ONCE))
    wanted = [(255, 0, 0), (128, 128, 0), (0, 255, 0), (0, 0, 255)]
    for tick, (height, colour) in enumerate(zip((0, 0.5, 1, 2), wanted, strict=True), 1):
        assert tuple(still(made, (0, height, 0), first=tick)[1:4]) == colour


def test_white_is_left_to_the_white_lamp() -> None:
    par = {**PAR, "mode": "RGBW"}
    made = rig(lights([par], {"reads": "steady", "drives": "colour", "colours": [[1, 0.6, 0.2]]}))
    assert list(still(made)[1:5]) == [204, 102, 0, 51]


@pytest.mark.parametrize("degrees", [-170, -90, 0, 30, 179])
def test_the_orientation_of_a_joint_drives_any_attribute(degrees: float) -> None:
    turned = quaternion.from_axis_angle([0, 1, 0], math.radians(degrees))
    made = rig(lights([HEAD], {"reads": "turn", "joint": "hand", "drives": "zoom"}))
    assert still(made, turned=turned)[20 + 11] == pytest.approx(255 * (degrees + 180) / 360, abs=1)


@settings(deadline=None)
@given(st.floats(-179, 179), st.floats(-80, 80), st.floats(-80, 80))
def test_turn_is_the_twist_and_lean_the_tip(heading: float, tip: float, around: float) -> None:
    q = quaternion.from_axis_angle([0, 1, 0], math.radians(heading))
    assert turn(q, (0, 1, 0)) == pytest.approx(heading, abs=1e-6)
    assert lean(q, (0, 1, 0)) == pytest.approx(0, abs=1e-5)
    direction = [math.sin(math.radians(around)), 0, math.cos(math.radians(around))]
    tipped = quaternion.multiply(q, quaternion.from_axis_angle(direction, math.radians(tip)))
    assert lean(tipped, (0, 1, 0)) == pytest.approx(abs(tip), abs=1e-4)


@settings(deadline=None)
@given(st.floats(0, 1))
def test_every_curve_keeps_its_ends_and_rises(value: float) -> None:
    points = [(0.0, 0.0), (0.3, 0.8), (1.0, 1.0)]
    for changes in ({}, {"curve": "s"}, {"curve": "gamma"}, {"curve": "points", "points": points}):
        rule = RuleConfig.model_validate({"reads": "height", "drives": "dimmer", **changes})
        assert bent(rule, 0.0) == 0.0
        assert bent(rule, 1.0) == 1.0
        assert 0.0 <= bent(rule, value) <= bent(rule, min(value + 0.01, 1.0)) <= 1.0


def test_curves_have_their_shapes() -> None:
    def of(value: float, **changes: Any) -> float:
        return bent(RuleConfig.model_validate({"reads": "height", "drives": "dimmer", **changes}), value)

    assert of(0.5) == 0.5
    assert of(0.25, curve="s") == pytest.approx(0.15625)
    assert of(0.5, curve="gamma", gamma=2.0) == pytest.approx(0.25)
    assert of(0.15, curve="points", points=[(0.0, 0.0), (0.3, 0.8), (1.0, 1.0)]) == pytest.approx(0.4)
    assert share(1.5, (2.0, 1.0)) == 0.5
    assert eased(0.2, 1.0, 0.0, 5.0, 0.02) == 1.0


@pytest.mark.parametrize(("mix", "wanted"), [("last", 102), ("highest", 153), ("sum", 255), ("product", 61)])
def test_a_later_rule_counts_unless_it_says_how_to_mix(mix: str, wanted: int) -> None:
    first = {"reads": "steady", "drives": "dimmer", "value": 0.6}
    second = {"reads": "steady", "drives": "dimmer", "value": 0.4, "mix": mix}
    assert still(rig(lights([PAR], first, second)))[DIMMER] == pytest.approx(wanted, abs=1)


def test_mixing_with_nothing_before_it_is_the_rule_alone() -> None:
    """White is where colours rest; a rule that mixes does not mix with that."""
    rule = {"reads": "steady", "drives": "colour", "colours": [[0, 0, 0.5]], "mix": "highest"}
    assert tuple(still(rig(lights([PAR], rule)))[1:4]) == (0, 0, 128)


def test_rules_touch_the_fixtures_that_they_name() -> None:
    made = rig(lights([PAR, OTHER], {"fixtures": ["other"], "reads": "steady", "drives": "dimmer"}))
    shown = still(made)
    assert (shown[0], shown[10]) == (0, 255)


def test_heads_aim_at_a_joint_with_an_offset_or_at_a_point() -> None:
    made = rig(
        lights(
            [HEAD, {**HEAD, "name": "second", "address": 41}],
            {"fixtures": ["head"], "reads": "place", "joint": "hand", "drives": "aim", "offset": [0, 0.5, 0]},
            {"fixtures": ["second"], "reads": "steady", "drives": "aim", "at": [1, 0, 1]},
        )
    )
    levels(made, *[(1.0, 1.0, 0.5)] * 200)
    beams = made.patch.heads.beams()
    for beam, point in zip(beams, [(1.0, 1.5, 0.5), (1, 0, 1)], strict=True):
        wanted = np.array(point) - [0, 4, 0]
        np.testing.assert_allclose(beam, wanted / np.linalg.norm(wanted), atol=1e-3)


def test_the_later_of_aim_and_pan_counts() -> None:
    aim = {"reads": "place", "joint": "hand", "drives": "aim"}
    pan = {"reads": "steady", "drives": "pan", "value": 0.75}
    by_pan, by_aim = rig(lights([HEAD], aim, pan)), rig(lights([HEAD], pan, aim))
    for made in (by_pan, by_aim):
        levels(made, *[(1.0, 1.0, 0.0)] * 200)
    assert by_pan.patch.heads.angles[0] == pytest.approx(135)
    assert by_aim.patch.heads.angles[0] != pytest.approx(135)


def test_heads_that_no_rule_moves_stay_where_they_are() -> None:
    config = lights([HEAD], {"reads": "place", "joint": "hand", "drives": "aim"}, second=[])
    made = rig(config)
    levels(made, *[(2.0, 1.0, 0.0)] * 200)
    before = made.patch.heads.angles.copy()
    levels(made, *[(-2.0, 1.0, 0.0)] * 100, show_state=ShowState().to(LIGHTS, "second"), first=201)
    np.testing.assert_allclose(made.patch.heads.angles, before)


def dark_then_bright() -> Rig:
    """A lamp that is dark in the first mapping, which is in force, and bright in the second."""
    config = lights(
        [PAR],
        {"reads": "steady", "drives": "dimmer", "value": 0.0},
        second=[{"reads": "steady", "drives": "dimmer", "value": 1.0}],
    )
    made = rig(config)
    still(made)
    return made


def test_one_mapping_fades_into_the_next() -> None:
    made = dark_then_bright()
    show_state = ShowState().to(LIGHTS, "first").to(LIGHTS, "second", 0.02, 1.0)
    shown = [level[DIMMER] / 255 for level in levels(made, *[(0, 1, 0)] * 60, show_state=show_state, first=2)]
    assert shown[24] == pytest.approx(0.5, abs=0.02)
    assert shown[-1] == 1.0
    assert np.diff(shown).max() < 0.03


def test_a_mapping_called_in_the_middle_of_a_fade_starts_from_what_is_seen() -> None:
    made = dark_then_bright()
    to_second = ShowState().to(LIGHTS, "second", 0.02, 1.0)
    shown = levels(made, *[(0, 1, 0)] * 20, show_state=to_second, first=2)
    back = to_second.to(LIGHTS, "first", 0.42, 1.0)
    shown += levels(made, *[(0, 1, 0)] * 60, show_state=back, first=22)
    dimmer = [level[DIMMER] / 255 for level in shown]
    assert np.abs(np.diff(dimmer)).max() < 0.03
    assert dimmer[-1] == 0.0


def test_points_to_aim_at_slide_across_the_stage() -> None:
    config = lights(
        [HEAD],
        {"reads": "steady", "drives": "aim", "at": [-2, 0, 1]},
        second=[{"reads": "steady", "drives": "aim", "at": [2, 0, 1]}],
    )
    made = rig(config)
    levels(made, *[(0, 1, 0)] * 200)
    show_state = ShowState().to(LIGHTS, "first").to(LIGHTS, "second", 4.0, 2.0)
    levels(made, *[(0, 1, 0)] * 50, show_state=show_state, first=201)  # half of it
    beam = made.patch.heads.beams()[0]
    on_floor = np.array([0, 4, 0]) + beam * (-4 / beam[1])
    np.testing.assert_allclose(on_floor, [0, 0, 1], atol=0.1)


def test_gobos_jump_in_the_middle_of_a_fade(tmp_path: Any) -> None:
    profile = {
        "name": "G",
        "modes": [{"name": "m", "channels": ["gobo"]}],
        "attributes": [{"name": "gobo", "snap": True}],
    }
    (tmp_path / "profiles").mkdir()
    (tmp_path / "profiles" / "gobo.yaml").write_text(yaml.safe_dump(profile))
    mappings = [
        {"name": name, "rules": [{"reads": "steady", "drives": "gobo", "value": value}]}
        for name, value in (("first", 0.2), ("second", 0.8))
    ]
    values = {"fixtures": [{"name": "g", "profile": "gobo", "address": 1}], "mappings": mappings}
    config = LightsConfig.model_validate(values, context={"directory": tmp_path})
    made = Rig(config, Patch(config.fixtures, tmp_path), SKELETON)
    made.safety = 0.0
    still(made)
    show_state = ShowState().to(LIGHTS, "first").to(LIGHTS, "second", 0.02, 1.0)
    shown = {level[0] for level in levels(made, *[(0, 1, 0)] * 60, show_state=show_state, first=2)}
    assert shown == {51, 204}


@pytest.mark.parametrize("broken", [(math.nan, 1.0, 0.0), (math.inf, 1.0, 0.0)])
def test_a_frame_that_is_no_number_moves_nothing(broken: Any) -> None:
    made = rig(
        lights(
            [PAR, HEAD],
            {"reads": "height", "joint": "hand", "drives": "dimmer"},
            {"reads": "place", "joint": "hand", "drives": "aim"},
        )
    )
    levels(made, *[(1.0, 1.0, 0.0)] * 200)
    before = still(made, (1.0, 1.0, 0.0), first=201)
    assert still(made, broken, first=202) == before
