"""The real keeper and a disk that hangs: files on other disks are kept meanwhile, and the keeper ends."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from appliance.box.checkpoint import FILE, Checkpoint, CheckpointWriter, Standing
from appliance.box.process_health import ProcessHealth
from appliance.box.ring_file import RingFileWriter
from appliance.keeper.fallback import JOURNAL_STOPPED, SENSORS_NOT_SAVED
from appliance.keeper.keeper import keep_rest
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import read_journal
from appliance.sensor.memory import FILE_NAME, memory_record
from appliance.show.box import load_box
from appliance.stage.recorder import FILE as JOURNAL_FILE
from appliance.stage.recorder import FORMAT, KIND
from tests.box import disks
from tests.bundles import write_show
from tests.logged import said
from tests.recorder.night import Night
from tests.standing import read_checkpoint
from tests.system.processes import BUNRAKU, Process, children, is_running, wait_until

MEMORY = b'{"neutral": [], "profiles": {}}'


class Keeper(Process):
    """`bunraku keep`, and the memory that it mirrors: a night danced by the test, a checkpoint."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.runtime = folder, folder / "runtime"
        self.night = Night(write_show(folder / "show"), self.runtime)
        self.place = CheckpointWriter(self.runtime)
        self.position_s = 0.0
        self.box_file = folder / "box.yaml"
        self.box_file.write_text(
            yaml.safe_dump({"runtime": "runtime", "state": "state", "journal": {"folder": "disk/journal"}})
        )
        super().__init__(folder / "words.txt", [*BUNRAKU, "keep", "--box", self.box_file])

    @property
    def journal(self) -> Path:
        return self.folder / "disk" / "journal"

    def saved_ticks(self) -> int:
        with contextlib.suppress(JournalError):
            return len(read_journal(self.journal).ticks)
        return 0

    def dance(self, ticks: int, saved: int) -> None:
        """Dance more ticks, and wait until the disk has `kept` in all."""
        self.night.dance(ticks)
        wait_until(lambda: self.saved_ticks() == saved, lambda: self.output)

    def follow_place(self, ended: bool = False) -> None:
        """Move the checkpoint on, and wait until the disk has it."""
        self.position_s += 0.02
        place = Checkpoint("A show", (Standing("main", self.position_s, (0.0, 30.0)),))
        self.place.write(replace(place, ended=ended))
        wait_until(
            lambda: self.saved_place() == self.position_s, lambda: f"the disk stays behind: {self.output}"
        )

    def saved_place(self) -> float | None:
        place = read_checkpoint(self.folder / "state" / FILE)
        return None if place is None else place.puppets[0].position_s

    def fallbacks(self) -> set[str]:
        """The keeper's fallbacks in force, as consoles see them."""
        with closing(ProcessHealth(self.runtime)) as processes:
            found = processes.fallbacks(time.monotonic())
        return {one.name for process, one in found if process == "keeper" and one.active}


@pytest.fixture
def keeper(tmp_path: Path) -> Iterator[Keeper]:
    (tmp_path / "disk").mkdir(exist_ok=True)
    with Keeper(tmp_path) as keeper:
        yield keeper


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A separate disk for the journal, which can be made to hang."""
    if reason := disks.why_not():
        pytest.skip(reason)
    with disks.disk(disks.made_image(tmp_path / "image", megabytes=16), tmp_path / "disk") as folder:
        yield folder


def test_a_journal_on_a_disk_that_hangs_holds_up_neither_place_nor_end(disk: Path, keeper: Keeper) -> None:
    keeper.dance(50, saved=50)
    keeper.follow_place()
    with disks.frozen(disk):
        keeper.night.dance(50)
        for _ in range(3):
            keeper.follow_place()
        wait_until(lambda: keeper.fallbacks() == {JOURNAL_STOPPED.name}, "the fallback is not reported")
        assert "The journal: the disk has not answered for 5 s" in keeper.output
        keeper.follow_place()
        assert keeper.end() == 0
        assert "The journal: the disk does not answer" in keeper.output
        keeper.start()  # the process that still hangs holds nothing that this one needs
        keeper.follow_place()
        keeper.follow_place(ended=True)
    wait_until(lambda: keeper.saved_ticks() == 100, lambda: keeper.output)
    wait_until(lambda: not keeper.fallbacks(), lambda: keeper.output)
    assert keeper.end() == 0
    (run,) = read_journal(keeper.journal).runs
    numbers = run.tick_numbers.tolist()
    assert numbers == list(range(1, 101))


def test_the_rest_that_a_keeper_left_does_not_wait_for_a_disk_that_hangs(disk: Path, keeper: Keeper) -> None:
    keeper.end()
    keeper.night.dance(10)
    keeper.place.write(Checkpoint("A show", (Standing("main", 7.5, (0.0, 30.0)),), ended=True))
    with disks.frozen(disk):
        keep_rest(load_box(keeper.box_file), keeper.runtime, keeper.journal, 1.0)
        assert keeper.saved_place() == 7.5
    assert any("The journal: the disk does not answer" in message for message in said)


def test_a_file_that_does_not_answer_holds_up_its_own_mirror_alone(tmp_path: Path) -> None:
    """A pipe in place of a frozen disk: opening it waits for a writer."""
    (tmp_path / "state").mkdir()
    os.mkfifo(tmp_path / "state" / FILE_NAME)
    (tmp_path / "disk").mkdir()
    (tmp_path / "runtime").mkdir(mode=0o700)
    with closing(memory_record(tmp_path / "state").writer(tmp_path / "runtime")) as memory:
        memory.write(MEMORY)
        with Keeper(tmp_path) as keeper:
            keeper.follow_place()
            keeper.dance(20, saved=20)
            wait_until(lambda: keeper.fallbacks() == {SENSORS_NOT_SAVED.name}, "the fallback is not reported")
            keeper.follow_place(ended=True)
            assert keeper.end() == 0


def test_a_journal_of_another_release_costs_neither_place_nor_keeper(keeper: Keeper) -> None:
    with closing(RingFileWriter.new(keeper.runtime / JOURNAL_FILE, KIND, FORMAT, [(1, 500)] * 3)) as other:
        other.rings[0].write(b"\xff\xfe")
        other.publish()
        keeper.follow_place()
        wait_until(lambda: JOURNAL_STOPPED.name in keeper.fallbacks(), lambda: keeper.output)
        keeper.follow_place()
    assert keeper.process.poll() is None
    assert "Traceback" not in keeper.output


def test_a_mirror_that_dies_is_started_again_and_the_others_go_on(keeper: Keeper) -> None:
    keeper.follow_place()
    keeper.dance(20, saved=20)
    for process in children(keeper.process.pid):
        os.kill(process, signal.SIGKILL)
    keeper.follow_place()
    keeper.dance(20, saved=40)
    assert "has died" in keeper.output
    wait_until(lambda: "carried to the disk again" in keeper.output, lambda: keeper.output)
    assert keeper.end() == 0


def test_mirrors_end_with_a_keeper_that_is_killed(keeper: Keeper) -> None:
    keeper.follow_place()
    wait_until(lambda: len(children(keeper.process.pid)) == 4, "not all have started")
    processes = children(keeper.process.pid)
    keeper.kill()
    wait_until(lambda: not any(map(is_running, processes)), "they outlive their keeper")
