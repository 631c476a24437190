"""Several puppets: each dances its own, one sensor leads two, a journal and a checkpoint know them all."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.checkpoint import Checkpoint, packed, unpacked
from appliance.cli.pictures import load_dance
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.recorder.journal_reader import read_journal
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.stage.comparison import Comparison
from appliance.stage.replay import Replay
from appliance.stage.sharing import facts_of
from appliance.stage.stage_error import StageError
from appliance.stage.stage_parts import assemble, measure_admission
from tests.bundles import swaying_phrase, write_show
from tests.recorder.night import BOX, Night, reading

SENSOR = {"sensor": "left-wrist", "joint": "lShldr"}
STILL, TURNED = (1.0, 0.0, 0.0, 0.0), (0.8, 0.6, 0.0, 0.0)
PUPPETS: list[dict[str, Any]] = [
    {"name": "left", "x": -0.8},
    {"name": "right", "x": 0.8, "z": 0.5, "turned": 90, "hands": [SENSOR]},
    {"name": "late", "z": -2.0, "start_s": 1.2, "iterations": [2, 1]},
    {"name": "slow", "phrase": "slow", "hands": [{"fixed": {}, "joint": "Chest"}]},
]


def write_puppets(folder: Path, puppets: list[dict[str, Any]] = PUPPETS, **more: Any) -> Path:
    apart = json.loads(json.dumps(puppets))  # the file has no aliases
    write_show(folder, [dict(SENSOR)], puppets=apart, motion={"phrases": {"slow": "slow.bvh"}}, **more)
    write_bvh(folder / "slow.bvh", swaying_phrase(7.0))
    return folder


@pytest.fixture
def night(tmp_path: Path) -> Night:
    through = [{"space": 0.0} | one for one in PUPPETS]
    return Night(write_puppets(tmp_path / "show", through), tmp_path / "run")


def test_each_puppet_stands_where_the_show_puts_it(night: Night) -> None:
    night.dance(1)
    left, right, late, slow = (puppet.frame for puppet in night.parts.puppets)
    assert left.positions[0, [0, 2]] == pytest.approx([-0.8, 0.0], abs=1e-5)
    assert right.positions[0, [0, 2]] == pytest.approx([0.8, 0.5], abs=1e-5)
    assert late.root[[0, 2]] == pytest.approx([0.0, -2.0], abs=1e-5)
    assert slow.root[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-5)
    turn = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.radians(90.0))
    hand = left.positions[3] - left.positions[0]
    assert right.positions[3] - right.positions[0] == pytest.approx(quaternion.rotate(turn, hand), abs=1e-5)
    for frame in (left, right, late, slow):  # each frame is of one piece
        positions, world = night.parts.skeleton.forward_kinematics(frame.pose[None], frame.root[None])
        assert positions[0] == pytest.approx(frame.positions, abs=1e-5)
        assert world[0] == pytest.approx(frame.world, abs=1e-5)


def test_one_sensor_leads_two_puppets_and_no_third(night: Night) -> None:
    night.dance(100, reading(STILL))
    night.dance(60, reading(TURNED))
    left, right, late, _ = (puppet.frame for puppet in night.parts.puppets)
    assert left.pose[2] == pytest.approx(right.pose[2], abs=1e-5)
    assert not np.allclose(left.pose[2], late.pose[2], atol=0.1)
    assert left.holds[2] == right.holds[2] == 1.0 and not late.holds.any()


def test_a_message_holds_a_joint_of_each_puppet_with_a_hand_by_osc(tmp_path: Path) -> None:
    osc: list[dict[str, Any]] = [{"osc": True, "joint": "Chest"}]
    puppets = [{"name": "a"}, {"name": "b", "hands": osc}, {"name": "c", "hands": osc}, {"name": "d"}]
    night = Night(write_puppets(tmp_path / "osc", puppets), tmp_path / "run")
    night.dance(5)
    assert night.order("hold", 0.0, 0.0, 1.0, 0.7, text="Chest")[0]
    night.dance(80)
    assert [float(puppet.frame.holds[1]) for puppet in night.parts.puppets] == [0.0, 1.0, 1.0, 0.0]
    night.order("release", text="Chest")
    night.dance(80)
    assert not any(puppet.frame.holds.any() for puppet in night.parts.puppets)
    assert not night.order("hold", 0.0, 0.0, 1.0, 0.7, text="lForeArm")[0]


def test_a_canon_follows_in_the_same_phrase(night: Night) -> None:
    chest = night.parts.skeleton.index("Chest")
    frames = [puppet.frame for puppet in night.parts.puppets]
    danced = []
    for _ in range(140):
        night.dance(1)
        danced.append([frame.pose[chest].copy() for frame in frames])
    first, late = (np.array(danced)[:, place] for place in (0, 2))
    shift = 60
    begun = 10  # ticks until windows overlap
    assert first[shift + begun : 110] == pytest.approx(late[begun : 110 - shift], abs=1e-3)


def test_a_stop_and_a_late_tick_hold_all_of_them(night: Night) -> None:
    night.dance(10)
    before = [puppet.motion.position_s for puppet in night.parts.puppets]
    night.dance(1, late_s=0.012)
    assert night.tick.frame.late and night.tick.frame.tick == 10
    assert [puppet.motion.position_s for puppet in night.parts.puppets] == before
    night.command("/player/rate", 0.5)
    assert {puppet.motion.rate for puppet in night.parts.puppets} == {0.5}


def test_their_journal_dances_again_bit_for_bit(night: Night, tmp_path: Path) -> None:
    night.dance(120, reading(STILL))
    night.command("/phrase", text="slow")
    night.dance(200, reading(TURNED))
    night.dance(420)
    run = read_journal(night.saved(tmp_path / "kept")).runs[0]
    for from_s in (0.0, 11.0):  # from the start, and from a later keyframe
        comparison = Comparison(float(run.ticks["frame_time"][0]), 0.0)
        danced = sum(1 for _ in Replay(run, load_show(tmp_path / "show")).dance(comparison, from_s))
        assert danced > 200 and comparison.first is None
    drawn = load_dance(tmp_path / "kept").part(2.0, 1.0)
    assert [len(one) for one in drawn.recordings] == [50] * 4
    assert np.array_equal(drawn.recordings[2].roots, run.ticks["root"][100:150, 2])
    assert drawn.names == ("left", "right", "late", "slow") and drawn.start_s == pytest.approx(2.0)
    assert np.array_equal(drawn.of_puppet("late").poses, drawn.recordings[2].poses)
    assert drawn.of_puppet(None) is drawn.recordings[0]
    with pytest.raises(StageError, match=r"no puppet 'nobody' danced. There are left, right, late, slow"):
        drawn.of_puppet("nobody")
    run = replace(run, ticks=run.ticks.copy())
    run.ticks["pose"][300, 3, 0] = [0.0, 1.0, 0.0, 0.0]
    comparison = Comparison(float(run.ticks["frame_time"][0]), 0.0)
    for _ in Replay(run, load_show(tmp_path / "show")).dance(comparison):
        pass
    assert comparison.first is not None and comparison.first.tick == 300


def test_a_restarted_stage_goes_on_with_all_of_them(night: Night, tmp_path: Path) -> None:
    night.dance(77, reading(TURNED))
    noted = tuple(puppet.noted for puppet in night.parts.puppets)
    place = Checkpoint("A test", noted)
    assert unpacked(packed(place)) == place
    assert unpacked(packed(place)[:-1]) is None
    again = Night(tmp_path / "show", tmp_path / "again")
    for puppet, one, before in zip(again.parts.puppets, noted, night.parts.puppets, strict=True):
        puppet.go_on(one, 1.0)
        assert puppet.motion.position_s == pytest.approx(before.motion.position_s, abs=1e-3)
    assert again.parts.puppets[2].iterations.coding == 2


def test_all_of_them_count_towards_the_budget(tmp_path: Path) -> None:
    show = load_show(write_puppets(tmp_path / "show"))
    parts = assemble(show, BOX)
    ran: list[tuple[int, int, int]] = []
    for number, puppet in enumerate(parts.puppets):
        _count(puppet.puppet, number, ran)
    measured = measure_admission(parts, BOX)
    assert {(0, 3, 2), (1, 3, 2), (2, 2, 1), (3, 3, 2)} <= set(ran)
    assert measured.puppets == 4 and "3 coding iterations of 4 puppets cost" in measured.sentence()
    parts.run_with(replace(measured, coding=2, interaction=1, most_coding=2))
    assert [(one.iterations.coding, one.iterations.interaction) for one in parts.puppets] == [(2, 1)] * 4


def test_the_shared_frame_has_room_for_them(night: Night, tmp_path: Path) -> None:
    facts = facts_of(night.show, None, night.parts.led.iterations, 0.0)
    writer = FrameWriter(tmp_path / "run", facts)
    night.parts.outputs.share(writer)
    night.dance(5, reading(STILL))
    reader = FrameReader(tmp_path / "run", lambda: 1000.0)
    seen = reader.newest(1000.0)
    assert reader.facts is not None and [one.name for one in reader.facts.puppets] == [
        *("left", "right", "late", "slow")
    ]
    assert seen is not None and seen.tick == 4
    assert reader.facts.led.name == "left" and reader.facts.led_in(seen) is seen.puppets[0]
    for frame, puppet in zip(seen.puppets, night.parts.puppets, strict=True):
        for name in ("pose", "world", "positions", "root", "holds"):
            assert np.array_equal(getattr(frame, name), getattr(puppet.frame, name)), name
    writer.close()


@pytest.mark.parametrize(
    ("puppets", "message"),
    [
        ([{"name": "a", "phrase": "slow"}], "it dances what the show says"),
        ([{"name": "a"}, {"name": "b", "phrase": "solw"}], "'b' starts from 'solw', which the show"),
        ([{"name": "a"}, {"name": "b", "hands": [SENSOR | {"from_start": False}]}], "Nothing lets this hand"),
        ([{"name": "a"}, {"name": "a"}], "Two puppets are called 'a'"),
        ([{"name": "a"}, {"name": "b", "iterations": [2, 3]}], "more than 2 coding iterations"),
        ([{"name": str(number)} for number in range(5)], "at most 4"),
        ([{"name": "a"}, {"name": "b", "hands": [SENSOR, SENSOR]}], "Two hands hold the joint 'lShldr'"),
    ],
)
def test_what_no_show_can_put_on_the_stage(
    tmp_path: Path, puppets: list[dict[str, Any]], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        load_show(write_puppets(tmp_path / "show", puppets))


def test_a_rule_of_lights_names_a_puppet_of_the_show(tmp_path: Path) -> None:
    rule = {"puppet": "rihgt", "reads": "height", "joint": "Hips", "drives": "dimmer"}
    fixture = {"name": "par", "profile": "led-par", "address": 1}
    lights = {"fixtures": [fixture], "mappings": [{"name": "one", "rules": [rule]}]}
    with pytest.raises(ConfigError, match=r"no puppet 'rihgt'. Did you mean 'right'\?"):
        load_show(write_puppets(tmp_path / "show", lights=lights))


def _count(puppet: Any, number: int, ran: list[tuple[int, int, int]]) -> None:
    real = puppet.hold

    def hold(*held: Any) -> Any:
        ran.append((number, *held[-2:]))
        return real(*held)

    puppet.hold = hold
