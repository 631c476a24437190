"""The real box's journal: what a night with real sensors and commands leaves dances again, bit for bit."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
import yaml

from appliance.box.checkpoint import CheckpointReader
from appliance.pose.bvh import write_bvh
from appliance.recorder.journal_error import JournalError
from appliance.recorder.reading import read_journal
from appliance.recorder.segments import segment_paths
from tests.bundles import swaying_phrase, write_show
from tests.show_control.doubles import Asker
from tests.system.box import JOURNAL, Box, playing
from tests.system.processes import BUNRAKU, PATIENCE_S, await_that, children_that_say
from tests.system.wearables import Wearables

pytestmark = pytest.mark.realtime

CUES = [{"name": "storm", "phrase": "slow", "iterations": [5, 4], "hands": ["lShldr"], "fade_s": 1.0}]


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_show(tmp_path_factory.mktemp("bundle") / "show")
    write_bvh(folder / "slow.bvh", swaying_phrase(7.0))
    config = yaml.safe_load((folder / "show.yaml").read_text())
    config |= {"motion": {"phrases": {"slow": "slow.bvh"}}, "cues": CUES}
    (folder / "show.yaml").write_text(yaml.safe_dump(config))
    return folder


def bunraku(*arguments: str) -> str:
    """What a command says; it must succeed."""
    done = subprocess.run(
        [*BUNRAKU, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def await_keeper(journal: Path, runs: int = 1) -> None:
    """Until a keeper has kept something of so many starts of the stage."""

    def are_kept() -> bool:
        with contextlib.suppress(JournalError):
            return len(read_journal(journal).runs) >= runs
        return False

    await_that(are_kept, f"nothing of {runs} runs was kept")


def disturb(box: Box) -> None:
    """Show control, a sensor that comes and goes, and a machine that stands still for a moment."""
    with contextlib.closing(Asker(box.control)) as console:
        with Wearables([box.key], box.sensors) as wearables:
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
        with Wearables([box.key], box.sensors) as wearables:
            wearables.dance()
            box.frames(60)


def await_rate(box: Box, rate: float) -> None:
    """What a player streams is not answered: until the stage has noted it."""
    until = time.monotonic() + PATIENCE_S
    with contextlib.closing(CheckpointReader(box.words_file.with_name("runtime"))) as reader:
        while (place := reader.read()) is None or place.rate != rate:
            assert time.monotonic() < until, place
            box.frames(5)


def test_a_night_and_its_restart_dance_again_from_the_disk_and_from_an_export(
    show: Path, tmp_path: Path
) -> None:
    journal, box_file = tmp_path / "run.journal", tmp_path / "box.yaml"
    with playing(show, tmp_path, settings=JOURNAL) as box:
        box.frames(1)
        disturb(box)
        await_keeper(journal)
        box.kill_and_restart()
        box.frames(30)
        await_keeper(journal, runs=2)
        assert box.end() == 0
    recording = read_journal(journal)
    orders = [event["order"]["name"] for event in recording.events if event["kind"] == "order"]
    assert {"cue", "neutral", "rate", "iterations"} <= set(orders)
    assert recording.runs[0].ticks["skipped"].any() and recording.runs[0].ticks["reading_here"].any()
    said = bunraku("replay", str(journal))
    assert said.count("All are the same, bit for bit.") == 2
    assert "Run 2" in said and "were not" not in said
    exported = tmp_path / "stick" / "night.bunraku"
    exported.parent.mkdir()
    assert str(exported) in bunraku("journal", "export", str(exported), "--box", str(box_file))
    assert bunraku("replay", str(exported)) == said
    assert len(bunraku("journal", "list", "--journal", str(exported)).splitlines()) == 2
    events = bunraku("journal", "list", "--journal", str(exported), "--events")
    assert "order: cue storm" in events and "said: Sensor left-wrist is linked" in events


def test_a_keeper_that_hangs_or_dies_costs_no_tick_of_the_journal(show: Path, tmp_path: Path) -> None:
    """As with a disk that does not answer: the keeper stands still, the stage and its memory do not."""
    journal = tmp_path / "run.journal"
    with playing(show, tmp_path, settings=JOURNAL) as box:
        await_keeper(journal)
        [keeper] = children_that_say(box.process.pid, "keep")
        keeper_stopped = box.frames(1)[0][0]
        os.kill(keeper, signal.SIGSTOP)
        frames = box.frames(100)
        assert frames[-1][0] >= keeper_stopped + 100
        os.kill(keeper, signal.SIGKILL)
        box.await_words("The keeper was killed")
        until_another(journal)
        assert box.end() == 0
    (run,) = read_journal(journal).runs
    numbers = run.tick_numbers.tolist()
    assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) > len(frames)


def until_another(journal: Path) -> None:
    """Until the keeper that was started instead has begun a segment of its own."""
    await_that(lambda: len(segment_paths(journal)) >= 2)


def test_a_file_in_the_place_of_the_journal_is_refused(show: Path, tmp_path: Path) -> None:
    (tmp_path / "old.journal").write_bytes(b"bunraku journal 1\n")
    with playing(show, tmp_path, "--journal", str(tmp_path / "old.journal")) as box:
        assert box.process.wait(PATIENCE_S) == 2
    assert "is a file, and a journal is a folder" in box.words
