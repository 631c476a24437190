"""The real box, killed in the middle of its dance: it goes on at the same place of the phrase."""

from __future__ import annotations

import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from appliance.box.checkpoint import FILE, Checkpoint, CheckpointReader
from tests.standing import read_checkpoint
from tests.system.box import Box, cut_power, playing
from tests.system.processes import wait_until

PLAY = (sys.executable, "-m", "appliance.start", "play")
PHRASE_S, TICK_S = 3.0, 0.02
WITH_JOURNAL = {"journal": {"folder": "journal"}}
NO_REALTIME: dict[str, Any] = {"realtime": {"enabled": False}, "control": None, "state": "state"}


@contextmanager
def playing_alone(show: Path, folder: Path, **settings: Any) -> Iterator[Box]:
    """A stage without companions."""
    with playing(show, folder, "--alone", command=PLAY, settings=NO_REALTIME | settings) as box:
        yield box


def checkpoint_of(box: Box) -> Checkpoint:
    with closing(CheckpointReader(box.runtime)) as reader:
        place = reader.read()
    assert place is not None
    return place


def await_saved_checkpoint(box: Box) -> None:
    """Wait until the keeper has written another checkpoint to the disk."""
    path = box.box_file.with_name("state") / FILE
    before = read_checkpoint(path)
    wait_until(lambda: read_checkpoint(path) not in (None, before), lambda: box.output, box.pause)


def danced(frames: list[list[Any]]) -> int:
    """In how many frames the phrase went on: a late one repeats a pose."""
    return sum(not frame[3] for frame in frames)


def has_gone_on(from_s: float, to_s: float, least: int, most: int) -> bool:
    """Whether a phrase, which loops, has gone on for this many ticks."""
    gone_on_s = (to_s - from_s - TICK_S * (least - 0.5)) % PHRASE_S
    return gone_on_s <= TICK_S * (most - least + 1)


def goes_on_at(box: Box, count: int) -> float:
    """Where the phrase goes on, as the box reports it for the `count`-th time."""
    box.await_output("goes on at", count)
    return float(box.output.split("goes on at ")[count].split()[0])


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSEGV, signal.SIGABRT])
def test_goes_on_at_the_same_place_however_it_died(show: Path, tmp_path: Path, how: int) -> None:
    with playing_alone(show, tmp_path) as box:
        frames = box.frames(30)
        box.end(how)
        frames += box.last_frames()
        died_at = checkpoint_of(box)
        # It may have died between sending its last frame and writing the checkpoint.
        assert not died_at.ended and has_gone_on(
            0.0, died_at.puppets[0].position_s, danced(frames) - 1, danced(frames)
        )
        box.kill_and_restart()
        frames = box.frames(10)
        assert goes_on_at(box, 1) == pytest.approx(
            died_at.puppets[0].position_s, abs=0.051
        )  # reported to a tenth
        now = checkpoint_of(box)
        assert (now.restarts, now.power_cuts) == (1, 0)
        assert has_gone_on(
            died_at.puppets[0].position_s, now.puppets[0].position_s, danced(frames) - 1, now.tick + 1
        )
        if how == signal.SIGABRT:  # the watchdog's: the traceback shows the line that hung
            assert "Fatal Python error: Aborted" in box.output and "run.py" in box.output


def test_kills_in_a_row(show: Path, tmp_path: Path, long_run: bool) -> None:
    with playing_alone(show, tmp_path) as box:
        began_at_s = 0.0
        for kill in range(1, 13 if long_run else 5):
            frames = box.frames(2)  # the first has a checkpoint by now
            box.end(signal.SIGKILL)
            frames += box.last_frames()
            died_at = checkpoint_of(box)
            assert died_at.restarts == kill - 1
            assert died_at.tick in (frames[-2][0], frames[-1][0])
            assert has_gone_on(began_at_s, died_at.puppets[0].position_s, danced(frames) - 1, danced(frames))
            began_at_s = died_at.puppets[0].position_s
            box.kill_and_restart()
        box.frames(3)


def test_a_show_that_was_ended_begins_at_the_beginning(show: Path, tmp_path: Path) -> None:
    with playing_alone(show, tmp_path) as box:
        box.frames(20)
        assert box.end() == 0
        assert checkpoint_of(box).ended
        box.kill_and_restart()
        box.frames(5)
        now = checkpoint_of(box)
        assert has_gone_on(0.0, now.puppets[0].position_s, 0, now.tick + 1)
        assert box.end() == 0
        assert "the show goes on" not in box.output


def test_a_show_that_was_ended_is_ended_on_the_disk_too(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, command=PLAY, settings=NO_REALTIME | WITH_JOURNAL) as box:
        await_saved_checkpoint(box)
        assert box.end() == 0
        place = read_checkpoint(tmp_path / "state" / FILE)
        assert place is not None and place.ended
        shutil.rmtree(box.runtime)
        box.kill_and_restart()
        box.frames(2)
        assert box.end() == 0
        assert "the show goes on" not in box.output


def test_after_a_power_cut_the_disk_s_place_is_taken(show: Path, tmp_path: Path) -> None:
    """The whole box with its keeper. A power cut takes the memory: the runtime folder and the boot id."""
    with playing(show, tmp_path, command=PLAY, settings=NO_REALTIME | WITH_JOURNAL) as box:
        await_saved_checkpoint(box)
        box.frames(60)
        await_saved_checkpoint(box)
        on_disk = cut_power(box, tmp_path / "state" / FILE)
        assert not on_disk.ended and on_disk.tick > 0
        box.start()
        box.frames(5)
        assert goes_on_at(box, 1) == pytest.approx(on_disk.puppets[0].position_s, abs=0.051)
        assert "After a power cut the show goes on" in box.output
        assert checkpoint_of(box).power_cuts == 1


def test_a_box_without_a_journal_keeps_its_place_on_the_disk_too(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, command=PLAY, settings=NO_REALTIME) as box:
        await_saved_checkpoint(box)
        assert box.end() == 0
        place = read_checkpoint(tmp_path / "state" / FILE)
        assert place is not None and place.ended


@pytest.mark.parametrize("resume", ["never", "after_crash"])
def test_the_box_file_decides_whether_it_goes_on(show: Path, tmp_path: Path, resume: str) -> None:
    with playing_alone(show, tmp_path, resume=resume) as box:
        box.frames(20)
        box.kill_and_restart()
        box.frames(3)
        assert box.end() == 0
        assert ("the show goes on" in box.output) == (resume == "after_crash")


def test_a_restart_measures_nothing_and_reads_no_phrase(show: Path, tmp_path: Path) -> None:
    with playing_alone(show, tmp_path) as box:
        box.frames(5)
        runtime = box.runtime
        measured = (runtime / "admission").read_bytes()
        [phrase] = (runtime / "prepared").iterdir()
        made = phrase.stat().st_mtime_ns
        box.kill_and_restart()
        box.frames(5)
        assert (runtime / "admission").read_bytes() == measured
        assert b'"asked_coding": 3' in measured
        assert phrase.stat().st_mtime_ns == made
