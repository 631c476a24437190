"""`bunraku journal export --training`: a rehearsal with a live dancer becomes recordings that train takes."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from appliance.box.clock import TICK_S
from appliance.box.live_pose import LivePoseReader, LivePoseWriter
from appliance.exchange.training_set import write_training_set
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.recorded_minutes import recorded_minutes
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import read_journal
from appliance.studio.data.catalogue import read_catalogue
from tests.bundles import FIGURE, write_show
from tests.command import Command
from tests.recorder.night import Night, reading

CHEST, FOREARM = FIGURE.index("Chest"), FIGURE.index("lForeArm")


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    motion = {"phrase": "phrase.bvh", "live": True}
    return write_show(tmp_path_factory.mktemp("bundle") / "show", motion=motion)


@pytest.fixture
def rehearsal(show: Path, tmp_path: Path) -> Iterator[Path]:
    """A live dancer for three seconds, a pause, and for another two and a half; a wrist and two orders."""
    night = Night(show, tmp_path / "runtime")
    night.parts.live_inbox = LivePoseReader(night.runtime)
    writer = LivePoseWriter(night.runtime)

    def dance_live(ticks: int) -> None:
        for tick in range(ticks):
            if tick % 2 == 0:  # 25 poses a second
                writer.write(night.slot.deadline + TICK_S - 0.001, (0.1 * tick, 0.9, 0.0), pose(tick))
            night.dance(1, reading((0.8, 0.6, 0.0, 0.0)))

    dance_live(150)
    night.command("/liveliness", 0.4, 3.0)
    night.dance(30)
    night.order("said to nobody")
    dance_live(125)
    yield night.saved(tmp_path / "journal")
    writer.close()
    night.parts.close()


def pose(tick: int) -> list[float]:
    """The chest leans further with each tick; nothing says how the forearm turns."""
    turns = np.tile(quaternion.IDENTITY, (len(FIGURE), 1)).astype(float)
    turns[CHEST] = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), 0.01 * tick)
    turns[FOREARM] = math.nan
    return [float(part) for part in turns.ravel()]


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_what_the_live_dancer_danced_comes_back(rehearsal: Path, tmp_path: Path) -> None:
    written = write_training_set(read_journal(rehearsal), tmp_path / "set")
    first, second = sorted(written.folder.glob("live_*.bvh"))
    dance = read_bvh(first)
    assert dance.skeleton.same_joints(FIGURE) and dance.fps == pytest.approx(50.0)
    assert dance.seconds == pytest.approx(3.0, abs=0.1)
    assert read_bvh(second).seconds == pytest.approx(2.5, abs=0.1)
    angles = 2 * np.arctan2(dance.poses[:, CHEST, 3], dance.poses[:, CHEST, 0])
    np.testing.assert_allclose(np.diff(angles), 0.01, atol=1e-3)
    np.testing.assert_allclose(np.diff(dance.roots[:, 0]), 0.1, atol=1e-2)
    assert np.isfinite(dance.poses).all()
    assert written.recordings == 2 and written.seconds == pytest.approx(5.5, abs=0.2)


def test_hands_sensors_and_orders_come_along(rehearsal: Path, tmp_path: Path) -> None:
    folder = write_training_set(read_journal(rehearsal), tmp_path / "set").folder
    sensors = rows(folder / "sensors.csv")
    assert len(sensors) == 275 and {one["sensor"] for one in sensors} == {"left-wrist"}
    assert float(sensors[0]["w"]) == 0.8 and sensors[0]["battery"] == "90"
    hands = rows(folder / "hands.csv")
    assert hands and {one["joint"] for one in hands} == {"lShldr"}
    asked = [one["what"] for one in rows(folder / "cues.csv")]
    assert any("liveliness" in one for one in asked)
    assert read_bvh(folder / "puppet" / "puppet_01.bvh").seconds == pytest.approx(305 * TICK_S, abs=0.05)


def test_train_takes_the_folder_as_it_is(rehearsal: Path, tmp_path: Path) -> None:
    """The recordings of the dancer, at their rate, and none of what the puppet answered."""
    folder = write_training_set(read_journal(rehearsal), tmp_path / "set").folder
    from appliance.studio.data.sources import given

    dataset = given(folder, None, (), keep=()).load(lambda files: files)
    assert sorted(take.name for take in dataset.takes) == ["live_01", "live_02"]
    assert recorded_minutes(folder)[0] == 2
    assert read_catalogue(folder / "catalogue.yaml").acknowledgement == "A rehearsal of A test."


@pytest.mark.parametrize(("frames", "time"), [("9" * 400, "0.01"), ("100", "1e999")])
def test_a_head_with_numbers_without_end_adds_no_minutes(tmp_path: Path, frames: str, time: str) -> None:
    """The page that lists the recordings on a stick got an error, or what no browser reads."""
    (tmp_path / "a.bvh").write_text(f"HIERARCHY\nMOTION\nFrames: {frames}\nFrame Time: {time}\n")
    (tmp_path / "b.bvh").write_text("HIERARCHY\nMOTION\nFrames: 600\nFrame Time: 0.1\n")
    assert recorded_minutes(tmp_path) == (2, 1.0)


def test_the_command_writes_it_once(rehearsal: Path, tmp_path: Path, bunraku: Command) -> None:
    out = tmp_path / "set"
    asked = ("journal", "export", "--journal", rehearsal, "--training", out)
    assert "2 recordings of the live dancer, 5 s" in bunraku(*asked).out
    assert "something already" in bunraku(*asked, status=2).err
    assert "leave the others out" in bunraku(*asked, "--bvh", tmp_path / "a.bvh", status=2).err
    assert not list(tmp_path.glob(".set*"))


def test_without_a_live_dancer_it_says_that_there_is_nothing(show: Path, tmp_path: Path) -> None:
    night = Night(show, tmp_path / "runtime")
    night.dance(10)
    written = write_training_set(read_journal(night.saved(tmp_path / "journal")), tmp_path / "set")
    assert written.recordings == 0 and "no live dancer" in written.sentence()
    night.parts.close()
    with pytest.raises(JournalError, match="Name a new folder"):
        write_training_set(read_journal(tmp_path / "journal"), tmp_path / "set")
