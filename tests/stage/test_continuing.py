"""Puppets that go on by themselves: a partner, after a live dancer, to a place; all of it replayed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.live_pose import LivePose
from appliance.dancer.turns import STRETCH_TICKS, answerer_leads
from appliance.pose import quaternion
from appliance.recorder.journal_reader import read_journal
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.stage.stage_error import StageError
from tests.bundles import FIGURE
from tests.recorder.night import Night
from tests.sources import write_show_with_sources
from tests.stage.test_live import Stream
from tests.stage.test_replay import danced

PAIR: list[dict[str, Any]] = [{"name": "a", "x": -1.0}, {"name": "b", "x": 1.0, "partner": "a"}]
READY = 150  # ticks: what it has danced is known, and the first choice is danced


def pair(folder: Path, **keys: Any) -> Path:
    return write_show_with_sources(folder, puppets=[dict(PAIR[0]), PAIR[1] | keys])


def poses(night: Night, ticks: int, number: int = 1) -> np.ndarray[Any, Any]:
    found = []
    for _ in range(ticks):
        night.dance(1)
        found.append(night.parts.puppets[number].frame.pose.copy())
    return np.array(found)


def test_a_partner_leaves_its_phrase_and_the_one_that_it_answers_does_not(tmp_path: Path) -> None:
    night, alone = Night(pair(tmp_path / "show"), tmp_path / "run"), write_show_with_sources(tmp_path / "one")
    other = Night(alone, tmp_path / "other")
    night.dance(READY)
    other.dance(READY)
    answers, leads, phrase = night.parts.puppets[1], night.parts.puppets[0], other.parts.puppets[0]
    assert np.array_equal(leads.frame.pose, phrase.frame.pose)
    assert quaternion.angle_between(answers.frame.pose, phrase.frame.pose).max() > 0.05
    assert answers.continued == 1.0 and leads.continued == 0.0
    made = poses(night, 100)
    steps = quaternion.angle_between(made[1:], made[:-1])
    assert steps.max() < 1.0 and steps.mean() > 0  # it moves; the small network is a wild one


def test_an_answer_depends_on_what_the_other_dances(tmp_path: Path) -> None:
    """Follow, contrast and indifference dance apart from each other; the same dial dances the same."""
    ends = []
    for number, follow in enumerate((1.0, 1.0, 0.5, 0.0)):
        night = Night(pair(tmp_path / f"show{number}", follow=follow), tmp_path / f"run{number}")
        night.dance(READY + 100)
        ends.append(night.parts.puppets[1].frame.pose.copy())
    assert np.array_equal(ends[0], ends[1])
    assert all(quaternion.angle_between(ends[0], one).max() > 1e-3 for one in ends[2:])


def test_a_partner_that_leads_is_answered(tmp_path: Path) -> None:
    night = Night(pair(tmp_path / "show", lead=1.0), tmp_path / "run")
    night.dance(READY + 60)
    assert night.parts.puppets[0].continued == 1.0
    night.command("/partner/lead", 0.0)
    night.dance(60)
    assert night.parts.puppets[0].continued == 0.0


@pytest.mark.parametrize("lead", [0.0, 0.25, 0.6, 1.0])
def test_the_partner_leads_for_its_share_of_the_time(lead: float) -> None:
    ticks = range(0, 40 * STRETCH_TICKS, 50)
    share = np.mean([answerer_leads(tick, lead, seed=7) for tick in ticks])
    assert share == pytest.approx(lead, abs=0.026)


def test_their_journal_dances_again_bit_for_bit(tmp_path: Path) -> None:
    night = Night(pair(tmp_path / "show", lead=0.5), tmp_path / "run")
    night.dance(300)
    night.command("/partner/follow", 0.2)
    night.command("/partner/delay", 0.8)
    night.dance(500)
    for from_s in (0.0, 11.0):
        run = read_journal(night.saved(tmp_path / "kept")).runs[0]
        assert danced(run, tmp_path / "show", from_s)[1].first is None


def test_a_puppet_goes_to_its_goal_and_stays_there(tmp_path: Path) -> None:
    show = write_show_with_sources(
        tmp_path / "show", motion={"goes_on": {}, "grounded": False}, puppets=[PAIR[0]]
    )
    night = Night(show, tmp_path / "run")
    night.dance(READY)
    night.command("/goal", 0.5, -0.7)
    night.dance(600)
    goal = np.array([0.5, -0.7])
    for _ in range(100):
        night.dance(1)
        assert np.linalg.norm(night.parts.led.frame.root[[0, 2]] - goal) < 0.1
    with pytest.raises(ValueError, match="z is missing"):
        night.command("/goal", 3.0)
    night.command("/goal")
    before = night.parts.led.frame.root.copy()
    night.dance(50)
    assert night.parts.led.continued == 0.0
    assert np.linalg.norm(night.parts.led.frame.root - before) < 0.2  # its phrase goes on from there


def test_after_a_guest_stands_still_the_puppet_goes_on_until_the_guest_moves(tmp_path: Path) -> None:
    show = write_show_with_sources(
        tmp_path / "show", motion={"live": True, "goes_on": {"after_s": 1.0}, "source": "live"}
    )
    night = Night(show, tmp_path / "run")
    stream = night.parts.live_inbox = Stream()

    def dance(ticks: int, moves: bool) -> None:
        for _ in range(ticks):
            now = night.slot.deadline
            turned = quaternion.from_axis_angle([0.0, 0.0, 1.0], 0.4 * np.sin(6.0 * now) if moves else 0.1)
            pose = np.tile(turned, (len(FIGURE), 1)).astype(np.float32)
            stream.coming = LivePose(now, (0.0, 0.9, 0.0), pose.tobytes())
            night.dance(1)

    night.command("/phrase", 0.0, text="live")
    dance(150, moves=True)
    assert night.parts.led.continued == 0.0
    dance(40, moves=False)
    assert night.parts.led.continued == 0.0  # not yet
    dance(120, moves=False)
    assert night.parts.led.continued == 1.0
    dance(60, moves=True)
    assert night.parts.led.continued == 0.0
    night.dance(200)  # the stream falls silent
    assert night.parts.led.continued == 1.0
    run = read_journal(night.saved(tmp_path / "kept")).runs[0]
    assert danced(run, tmp_path / "show")[1].first is None


def test_a_partner_that_is_nobody_and_a_missing_network_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"'b' answers 'c', which is no other puppet\. Known: a"):
        load_show(pair(tmp_path / "nobody", partner="c"))
    with pytest.raises(ConfigError, match="which is no other puppet"):
        load_show(pair(tmp_path / "self", partner="b"))
    both = [PAIR[0] | {"partner": "b"}, dict(PAIR[1])]
    with pytest.raises(ConfigError, match="'b' answers 'a', but 'a' is a partner already"):
        load_show(write_show_with_sources(tmp_path / "both", puppets=both))
    show = pair(tmp_path / "show")
    (show / "partner.onnx").write_bytes(b"")
    with pytest.raises(StageError, match="no puppet can go on by itself"):
        Night(show, tmp_path / "run")


def test_levers_of_a_partner_say_where_there_is_none(tmp_path: Path) -> None:
    night = Night(write_show_with_sources(tmp_path / "show"), tmp_path / "run")
    with pytest.raises(ValueError, match="No puppet of this show has a `partner`"):
        night.command("/partner/follow", 0.3)
    assert night.order("follow", 0.3) == (
        False,
        "No puppet of this show goes on by itself, and none has a partner.",
    )
