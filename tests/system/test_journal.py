"""The real box's journal: a night with real sensors and commands replays bit for bit."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path

import pytest

from appliance.box.checkpoint import CheckpointReader
from appliance.pose.bvh import write_bvh
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import read_journal
from appliance.recorder.segments import segment_paths
from tests.bundles import swaying_phrase, write_show
from tests.show_control.doubles import Asker
from tests.system.box import JOURNAL, Box, playing
from tests.system.processes import PATIENCE_S, children_running, run_bunraku, wait_until

pytestmark = pytest.mark.realtime

CUES = [{"name": "storm", "phrase": "slow", "iterations": [5, 4], "hands": ["lShldr"], "fade_s": 1.0}]


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle") / "show"
    write_show(folder, motion={"phrases": {"slow": "slow.bvh"}}, cues=CUES)
    write_bvh(folder / "slow.bvh", swaying_phrase(7.0))
    return folder


def output_of(*arguments: str | Path) -> str:
    """The output of a command of bunraku, which must succeed."""
    done = run_bunraku(*arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def await_runs(journal: Path, runs: int = 1) -> None:
    """Wait until the journal on the disk has this many starts of the stage."""

    def are_saved() -> bool:
        with contextlib.suppress(JournalError):
            return len(read_journal(journal).runs) >= runs
        return False

    wait_until(are_saved, f"there are not {runs} runs")


def disturb(box: Box) -> None:
    """Show control, a sensor that comes and goes, and a machine that stands still for a moment."""
    with contextlib.closing(Asker(box.control)) as console:
        with box.wearables() as wearables:
            box.frame_that(lambda frame: frame[2] > 20)
            assert console.order("/cue", "storm")[2] == 1
            console.order("/sensors/neutral")
            wearables.dance()
            box.frames(60)
        console.tell("/player/rate", -1.0)
        box.process.send_signal(signal.SIGSTOP)
        time.sleep(0.15)
        box.process.send_signal(signal.SIGCONT)
        box.frames(30)
        await_rate(box, -1.0)
        assert console.order("/iterations", 2, 1)[2] == 1
        with box.wearables() as wearables:
            wearables.dance()
            box.frames(60)


def await_rate(box: Box, rate: float) -> None:
    """Wait until the stage has noted this rate: what a player streams is not answered."""
    with contextlib.closing(CheckpointReader(box.runtime)) as reader:
        wait_until(
            lambda: (place := reader.read()) is not None and place.rate == rate,
            lambda: reader.read(),
            box.pause,
        )


def test_a_night_and_its_restart_dance_again_from_the_disk_and_from_an_export(
    show: Path, tmp_path: Path
) -> None:
    journal = tmp_path / "run.journal"
    with playing(show, tmp_path, settings=JOURNAL) as box:
        box.frames(1)
        disturb(box)
        await_runs(journal)
        box.kill_and_restart()
        box.frames(30)
        await_runs(journal, runs=2)
        assert box.end() == 0
    recording = read_journal(journal)
    orders = [event["order"]["name"] for event in recording.events if event["kind"] == "order"]
    assert {"cue", "neutral", "rate", "iterations"} <= set(orders)
    assert recording.runs[0].ticks["skipped"].any() and recording.runs[0].ticks["reading_here"].any()
    said = output_of("replay", journal)
    assert said.count("All are the same, bit for bit.") == 2
    assert "Run 2" in said and "were not" not in said
    exported = tmp_path / "stick" / "night.bunraku"
    exported.parent.mkdir()
    assert str(exported) in output_of("journal", "export", exported, "--box", box.box_file)
    assert output_of("replay", exported) == said
    assert len(output_of("journal", "list", "--journal", exported).splitlines()) == 2
    events = output_of("journal", "list", "--journal", exported, "--events")
    assert "order: cue storm" in events and "said: Sensor left-wrist is linked" in events


def test_a_keeper_that_hangs_or_dies_costs_no_tick_of_the_journal(show: Path, tmp_path: Path) -> None:
    """As with a disk that does not answer: the keeper stops, the stage and its memory go on."""
    journal = tmp_path / "run.journal"
    with playing(show, tmp_path, settings=JOURNAL) as box:
        await_runs(journal)
        [keeper] = children_running(box.process.pid, "keep")
        keeper_stopped = box.frames(1)[0][0]
        os.kill(keeper, signal.SIGSTOP)
        frames = box.frames(100)
        assert frames[-1][0] >= keeper_stopped + 100
        os.kill(keeper, signal.SIGKILL)
        box.await_output("The keeper was killed")
        wait_until(lambda: len(segment_paths(journal)) >= 2, "the next keeper began no segment of its own")
        assert box.end() == 0
    (run,) = read_journal(journal).runs
    numbers = run.tick_numbers.tolist()
    assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) > len(frames)


def test_a_file_in_place_of_the_journal_is_refused(show: Path, tmp_path: Path) -> None:
    (tmp_path / "old.journal").write_bytes(b"bunraku journal 1\n")
    with playing(show, tmp_path, "--journal", str(tmp_path / "old.journal")) as box:
        assert box.process.wait(PATIENCE_S) == 2
    assert "is a file, and a journal is a folder" in box.output
