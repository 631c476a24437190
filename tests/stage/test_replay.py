"""A journal dances again bit for bit: from any keyframe, with all that a night brings, and after a kill."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.box.clock import TICK_S
from appliance.box.snapshot import packed, unpacked
from appliance.cli.replay import replay as replay_journal
from appliance.pose.bvh import write_bvh
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import Run, read_journal
from appliance.recorder.record import NOT_FINITE, RESENT
from appliance.show.show import load_show
from appliance.stage.comparison import Comparison
from appliance.stage.replay import Replay
from tests.bundles import swaying_phrase, write_show
from tests.recorder.night import Night, reading

HANDS: list[dict[str, object]] = [
    {"sensor": "left-wrist", "joint": "lShldr"},
    {"osc": True, "joint": "Chest"},
    {"turning": {"axis": [0, 1, 0], "seconds_per_turn": 5.0}, "joint": "rThigh", "weight": 0.7},
    {"kept": True, "joint": "lForeArm"},
    {"springs": "storm", "joint": "Hips"},
]
CUES = [
    {"name": "storm", "phrase": "slow", "iterations": [8, 7], "hands": ["Chest", "lForeArm"], "fade_s": 3.0},
    {"name": "calm", "phrase": "main", "iterations": [2, 2], "hands": ["lShldr", "rThigh"], "fade_s": 1.0},
]
STILL, TURNED, OTHER = (1.0, 0.0, 0.0, 0.0), (0.8, 0.6, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a show and the journal of an eventful night: for reading."""
    folder = tmp_path_factory.mktemp("night")
    eventful(Night(write_eventful_show(folder / "show"), folder / "runtime")).saved(folder / "journal")
    return folder


@pytest.fixture
def show(shared: Path) -> Path:
    return shared / "show"


def write_eventful_show(folder: Path) -> Path:
    """Two phrases, cues, hands of five kinds, a network that fails at seven iterations."""
    write_show(folder, HANDS, "fragile")
    write_bvh(folder / "slow.bvh", swaying_phrase(7.0))
    config = yaml.safe_load((folder / "show.yaml").read_text())
    config |= {"motion": {"phrases": {"slow": "slow.bvh"}}, "cues": CUES}
    (folder / "show.yaml").write_text(yaml.safe_dump(config))
    return folder


def eventful(night: Night) -> Night:
    """A night in which all happens that may happen."""
    night.dance(60, reading(STILL))
    night.order("neutral")
    night.dance(40, reading(STILL))
    night.dance(30, reading(TURNED))
    night.order("hold", 0.0, 0.0, 1.0, 0.7, text="Chest")
    night.order("kick", 1.0, -2.0, 0.5)
    night.order("wind", 3.0, 0.0, -3.0)
    night.order("feedback", 0.8, 2.0)
    night.dance(200, reading(OTHER))
    night.order("springs", 1.5, text="loose")
    night.order("stiffness", 4.0)
    night.order("gate", 0.0, 0.0)
    night.order("feedback", 1.0, 0.0)
    night.order("gate", 1.0, 1.0)
    night.command("/cue", text="storm")
    night.dance(40, reading(TURNED))
    night.dance(70)  # the sensor falls silent
    night.command("/hold", 1.0, text="Chest")
    night.dance(50, reading(OTHER, boot_nonce=2))  # and is switched on again
    night.command("/player/rate", -1.5)
    night.dance(3, reading(OTHER, boot_nonce=2), late_s=0.012)
    night.order("jump", 1.2)
    night.dance(100, reading(TURNED, boot_nonce=2, taps=1))
    night.command("/iterations", 7.0, 6.0)
    night.dance(20, reading(TURNED, boot_nonce=2, taps=1))
    night.order("excerpt", 0.5, 2.5)
    night.order("heading")
    night.command("/liveliness", 0.4, 3.0)
    night.command("/seed", 77)
    night.command("/iterations", 4.0, 3.0)
    night.dance(400, reading(OTHER, boot_nonce=3, wearable=2))  # a spare under the same name
    night.command("/cue", text="calm")
    night.dance(30, reading(OTHER, boot_nonce=3, wearable=2))
    return night


@pytest.fixture
def run(shared: Path) -> Run:
    (run,) = read_journal(shared / "journal").runs
    return run


def danced(run: Run, show: Path, from_s: float = 0.0) -> tuple[Replay, Comparison]:
    replay = Replay(run, load_show(show))
    comparison = Comparison(float(run.ticks["frame_time"][0]), 0.0)
    for _ in replay.dance(comparison, from_s):
        pass
    return replay, comparison


def test_a_night_of_cues_silences_late_ticks_and_failures_dances_again_bit_for_bit(
    run: Run, show: Path
) -> None:
    assert (run.ticks["flags"] & RESENT).any() and (run.ticks["flags"] & NOT_FINITE).any()
    assert run.ticks["weights"][:, 0].max() == 1.0 and len(run.keyframes) == 3
    replay, comparison = danced(run, show)
    assert comparison.first is None and comparison.worst is None
    assert (comparison.ticks, replay.skipped, replay.forced) == (len(run.ticks), 0, 0)


@pytest.mark.parametrize("keyframe", [1, 2])
def test_it_begins_in_the_middle_of_the_show(run: Run, show: Path, keyframe: int) -> None:
    at_s = float(run.ticks["frame_time"][500 * keyframe] - run.ticks["frame_time"][0])
    _, comparison = danced(run, show, at_s + 0.5)
    assert comparison.first is None
    assert comparison.ticks == len(run.ticks) - 500 * keyframe


def test_the_whole_state_is_as_it_was_at_every_keyframe(run: Run, show: Path) -> None:
    """Nothing is forgotten in a state that only shows later."""
    replay = Replay(run, load_show(show))
    states = {0: unpacked(packed(replay.tick))}
    comparison = Comparison(0.0, 0.0)
    for count in replay.dance(comparison):
        if count in (500, 1000):
            states[count] = unpacked(packed(replay.tick))
    for (_, data), count in zip(run.keyframes[1:], (500, 1000), strict=True):
        assert same(unpacked(data), states[count]) == []


def same(one: object, other: object, path: str = "") -> list[str]:
    """Where two states differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            message for key in one | other for message in same(one.get(key), other.get(key), f"{path}.{key}")
        ]
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return [] if one.tobytes() == other.tobytes() else [path]
    if isinstance(one, list | tuple) and isinstance(other, list | tuple) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        return [message for place, (a, b) in pairs for message in same(a, b, f"{path}[{place}]")]
    return [] if one == other else [f"{path}: {one} and {other}"]


def test_what_was_lost_in_between_is_left_out_and_the_rest_dances_on(run: Run, show: Path) -> None:
    kept = np.r_[0:300, 420 : len(run.ticks)]
    torn = Run(run.header, run.ticks[kept], run.tick_numbers[kept], run.events, run.keyframes)
    replay, comparison = danced(torn, show)
    assert comparison.first is None
    assert (comparison.ticks, replay.skipped) == (len(run.ticks) - 200, 80)


def test_the_first_tick_that_differs_is_named_with_its_joint(run: Run, show: Path) -> None:
    ticks = run.ticks.copy()
    ticks["pose"][777, 0, 3] = (0.8, 0.6, 0.0, 0.0)
    _, comparison = danced(Run(run.header, ticks, run.tick_numbers, run.events, run.keyframes), show)
    assert comparison.first is not None
    assert (comparison.first.tick, comparison.first.joint) == (777, "lForeArm")
    assert comparison.first == comparison.worst
    assert "lForeArm is off by" in comparison.first.sentence()


def test_a_reading_that_never_came_changes_the_dance_from_there_on(run: Run, show: Path) -> None:
    ticks = run.ticks.copy()
    ticks["reading_here"][250] = 0
    _, comparison = danced(Run(run.header, ticks, run.tick_numbers, run.events, run.keyframes), show)
    assert comparison.first is not None and comparison.first.tick == 250
    assert "reading 250 went into it then, 249 here" in comparison.first.sentence()


def test_a_failure_of_the_network_that_does_not_come_back_is_taken_from_the_journal(
    run: Run, tmp_path: Path
) -> None:
    sound = write_eventful_show(tmp_path / "sound")
    network = write_show(tmp_path / "network", HANDS) / "puppet.onnx"
    (sound / "puppet.onnx").write_bytes(network.read_bytes())
    replay, comparison = danced(run, sound)
    failed = int(((run.ticks["flags"] & NOT_FINITE) != 0).sum())
    assert replay.forced == failed >= 20
    assert comparison.worst is None or comparison.worst.degrees < 1e-3  # multiplied and divided, or not


def test_the_command_says_what_it_found(
    run: Run, shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = shared / "journal"
    assert replay_journal(journal, None, 0.0, None) == 0
    said = capsys.readouterr().out
    assert f"{len(run.ticks)} ticks danced again" in said and "All are the same, bit for bit" in said
    other = write_eventful_show(tmp_path / "other")
    config = yaml.safe_load((other / "show.yaml").read_text())
    config["hands"][2]["weight"] = 1.0
    (other / "show.yaml").write_text(yaml.safe_dump(config))
    assert replay_journal(journal, other, 0.0, None) == 0  # weights are part of the state, as they were
    assert "Other than in the recording: the show's show.yaml" in capsys.readouterr().out
    write_bvh(other / "phrase.bvh", swaying_phrase(3.5))
    assert replay_journal(journal, other, 0.0, 0.1) == 1
    assert "The first that differs (within 0.1 degrees" in capsys.readouterr().out


def test_another_show_is_refused_in_words(run: Run, tmp_path: Path) -> None:
    other = write_show(tmp_path / "other")
    with pytest.raises(JournalError, match="other hands than the recorded one"):
        Replay(run, load_show(other))
    night = Night(write_eventful_show(tmp_path / "show"), tmp_path / "runtime")
    night.dance(20)
    night.saved(tmp_path / "journal")
    (tmp_path / "show").rename(tmp_path / "elsewhere")
    with pytest.raises(JournalError, match=r"is not where it was.*--show"):
        replay_journal(tmp_path / "journal", None, 0.0, None)


def test_after_an_order_that_takes_several_entries_it_dances_on(show: Path, tmp_path: Path) -> None:
    night = Night(show, tmp_path / "run")
    night.dance(20)
    assert not night.order("phrase", text="nobody's " * 400)[0]
    night.dance(20)
    run = read_journal(night.saved(tmp_path / "kept")).runs[0]
    assert len(run.pieces) > 2
    replay = Replay(run, load_show(show))
    comparison = Comparison(float(run.ticks["frame_time"][0]), 0.0)
    assert [*replay.dance(comparison)][-1] == 40 and replay.skipped == 0 and comparison.first is None


def test_an_order_that_nobody_heard_and_a_stop_dance_again_as_they_did(show: Path, tmp_path: Path) -> None:
    night = Night(show, tmp_path / "runtime")
    night.dance(130, reading(STILL))
    night.dance(40)
    done, message = night.order("heading")
    assert not done and "at this moment" in message
    night.slot.tick += 60  # the machine was held up
    night.slot.deadline += 60 * TICK_S
    night.dance(400, reading(TURNED))
    [run] = read_journal(night.saved(tmp_path / "journal")).runs
    _, comparison = danced(run, show)
    assert comparison.first is None
    assert comparison.ticks == len(run.ticks) == 570


def test_two_starts_of_the_stage_are_two_runs(show: Path, tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    for _ in range(2):
        night = Night(show, tmp_path / "runtime")
        night.dance(60, reading(TURNED))
        night.saved(journal)
    recording = read_journal(journal)
    assert [len(run.ticks) for run in recording.runs] == [60, 60]
    assert len(recording.ticks) == 120
    for run in recording.runs:
        assert danced(run, show)[1].first is None
