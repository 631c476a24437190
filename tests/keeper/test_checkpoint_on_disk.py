"""The place on the disk: torn, damaged, full, read-only, gone, cut off: one place is always whole."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from appliance.box.checkpoint import FILE, Checkpoint, CheckpointWriter, Standing, packed
from appliance.box.record import SLOT_BYTES, SLOT_CAPACITY, SLOTS, SlotFile
from appliance.keeper.mirror import RETRY_S, TURN_S, Mirror
from appliance.keeper.records import mirrored_checkpoint
from tests.box import disks
from tests.deploy.cut import cut_off
from tests.logged import said
from tests.standing import moved, read_checkpoint

HEAD_BYTES = 24  # of a slot
PLACE = Checkpoint("A show", (Standing("main", 1.5, (0.0, 30.0), let_go=("lShldr",)),), boot="here")

needs_mounts = pytest.mark.skipif(disks.why_not() is not None, reason=str(disks.why_not()))


def at(tick: int) -> Checkpoint:
    return replace(PLACE, tick=tick)


def written(path: Path, *ticks: int) -> None:
    file = SlotFile(path)
    for tick in ticks:
        file.write(packed(at(tick)))
    file.close()


class Mirrored:
    """A mirror with its folders, a stage's end of the place, and what was said."""

    def __init__(self, runtime: Path, state: Path) -> None:
        runtime.mkdir(exist_ok=True)
        self.said = said
        self.stage = CheckpointWriter(runtime)
        self.state = state
        self.mirror = Mirror(mirrored_checkpoint(runtime, state))

    @property
    def on_disk(self) -> Checkpoint | None:
        return read_checkpoint(self.state / FILE)


@pytest.fixture
def mirrored(tmp_path: Path) -> Iterator[Mirrored]:
    one = Mirrored(tmp_path / "runtime", tmp_path / "state")
    yield one
    one.stage.close()


def test_the_newest_is_read(tmp_path: Path) -> None:
    path = tmp_path / "state" / FILE
    for newest in range(1, 6):
        written(path, newest)
        assert read_checkpoint(path) == at(newest)
    assert path.stat().st_size == SLOTS * SLOT_BYTES
    assert [one.name for one in path.parent.iterdir()] == [FILE]


def test_no_file_a_folder_and_rubbish_are_no_place(tmp_path: Path) -> None:
    assert read_checkpoint(tmp_path / FILE) is None
    (tmp_path / FILE).mkdir()
    assert read_checkpoint(tmp_path / FILE) is None
    (tmp_path / FILE).rmdir()
    for rubbish in (b"", b"x" * 100, bytes(8192), os.urandom(8192), os.urandom(20000)):
        (tmp_path / FILE).write_bytes(rubbish)
        assert read_checkpoint(tmp_path / FILE) is None
        written(tmp_path / FILE, 7)
        assert read_checkpoint(tmp_path / FILE) == at(7)


@pytest.mark.parametrize("newest", [8, 9])
def test_whichever_byte_is_damaged_one_of_the_two_newest_is_taken(tmp_path: Path, newest: int) -> None:
    path = tmp_path / FILE
    written(path, *range(1, newest + 1))
    whole = path.read_bytes()
    slot = newest % SLOTS * SLOT_BYTES
    says_something = range(slot, slot + HEAD_BYTES + len(packed(at(newest))))
    for place in [*says_something, *range(0, len(whole), 61)]:
        damaged = bytearray(whole)
        damaged[place] ^= 0xFF
        path.write_bytes(damaged)
        assert read_checkpoint(path) == at(newest - 1 if place in says_something else newest)


def test_a_write_torn_at_any_byte_leaves_the_place_before(tmp_path: Path) -> None:
    path = tmp_path / FILE
    written(path, 1, 2)
    before = path.read_bytes()
    written(path, 3)
    after = path.read_bytes()
    for torn in range(0, len(after), 97):
        path.write_bytes(after[:torn] + before[torn:])
        assert read_checkpoint(path) in (at(2), at(3))
        written(path, 4)  # and over a torn slot, never over the whole one
        assert read_checkpoint(path) == at(4)
        path.write_bytes(before)


def test_more_than_a_slot_holds_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    written(tmp_path / FILE, 1)
    before = (tmp_path / FILE).read_bytes()
    with closing(SlotFile(tmp_path / FILE)) as file, pytest.raises(ValueError, match=str(SLOT_CAPACITY)):
        file.write(bytes(SLOT_CAPACITY + 1))
    assert (tmp_path / FILE).read_bytes() == before


def test_the_older_slot_is_the_one_that_is_written(tmp_path: Path) -> None:
    path = tmp_path / FILE
    written(path, 1, 2)
    slots = [path.read_bytes()[slot * SLOT_BYTES :][:SLOT_BYTES] for slot in range(SLOTS)]
    newest = next(slot for slot in range(SLOTS) if _alone(tmp_path / "one", slots, slot) == at(2))
    written(path, 3)
    assert path.read_bytes()[newest * SLOT_BYTES :][:SLOT_BYTES] == slots[newest]


def _alone(path: Path, slots: list[bytes], slot: int) -> Checkpoint | None:
    path.write_bytes(b"".join(one if place == slot else bytes(SLOT_BYTES) for place, one in enumerate(slots)))
    return read_checkpoint(path)


def test_a_file_that_another_disk_covers_is_left(tmp_path: Path) -> None:
    """A data partition that is mounted late lies over the folder in which the file was made."""
    file = SlotFile(tmp_path / "state" / FILE)
    file.write(packed(at(1)))
    (tmp_path / "state").rename(tmp_path / "covered")
    file.write(packed(at(2)))
    file.close()
    assert read_checkpoint(tmp_path / "covered" / FILE) == at(1)
    assert read_checkpoint(tmp_path / "state" / FILE) == at(2)


def test_carried_once_in_each_turn_and_only_what_is_new(mirrored: Mirrored) -> None:
    mirrored.mirror.turn(100.0)
    assert not mirrored.state.exists()
    mirrored.stage.write(at(1))
    mirrored.mirror.turn(100.0 + TURN_S)
    assert mirrored.on_disk == at(1)
    before = (mirrored.state / FILE).read_bytes()
    mirrored.stage.write(at(2))  # a show that stands: only its ticks go on
    mirrored.mirror.turn(110.0)
    assert (mirrored.state / FILE).read_bytes() == before
    mirrored.stage.write(moved(PLACE, position_s=2.0))
    mirrored.mirror.turn(120.0)
    assert mirrored.on_disk == moved(PLACE, position_s=2.0)
    assert mirrored.said == []


def test_the_last_turn_carries_what_is_newest(mirrored: Mirrored) -> None:
    mirrored.stage.write(at(1))
    mirrored.mirror.turn(100.0)
    mirrored.stage.write(moved(PLACE, position_s=2.0, ended=True))
    mirrored.mirror.last_turn(100.5)
    assert mirrored.on_disk == moved(PLACE, position_s=2.0, ended=True)


@needs_mounts
def test_a_full_disk_is_survived(mirrored: Mirrored) -> None:
    with disks.tiny(mirrored.state, "4k"):  # one of the two slots fits
        mirrored.stage.write(at(1))
        mirrored.mirror.turn(100.0)
        assert mirrored.on_disk is None
        assert len(mirrored.said) == 1 and "No space left" in mirrored.said[0]
        assert list(mirrored.state.iterdir()) == []  # nothing half-written is left
    with disks.tiny(mirrored.state, "8k"):
        mirrored.mirror.turn(110.0)
        assert mirrored.on_disk == at(1)


@needs_mounts
def test_a_disk_that_fills_up_later_takes_the_place_all_the_same(mirrored: Mirrored) -> None:
    """All the room that it will ever need was taken when the file was made."""
    with disks.tiny(mirrored.state, "64k"):
        mirrored.stage.write(at(1))
        mirrored.mirror.turn(100.0)
        disks.fill(mirrored.state)
        for turn in range(1, 5):
            mirrored.stage.write(moved(PLACE, position_s=float(turn)))
            mirrored.mirror.turn(100.0 + turn)
            assert mirrored.on_disk == moved(PLACE, position_s=float(turn))
        assert mirrored.said == []


@needs_mounts
def test_a_read_only_disk_is_survived_and_taken_again_later(tmp_path: Path, mirrored: Mirrored) -> None:
    image = disks.made_image(tmp_path / "image")
    with disks.disk(image, mirrored.state):
        written(mirrored.state / FILE, 1)
    mirrored.stage.write(moved(PLACE, position_s=2.0))
    with disks.disk(image, mirrored.state, "ro"):
        for turn in range(3):
            mirrored.mirror.turn(100.0 + RETRY_S * turn)
        assert mirrored.on_disk == at(1)  # it can still be read
        assert len(mirrored.said) == 1 and "Read-only" in mirrored.said[0]
    with disks.disk(image, mirrored.state):
        mirrored.mirror.turn(200.0)
        assert mirrored.on_disk == moved(PLACE, position_s=2.0)


@needs_mounts
def test_a_disk_that_fails_in_the_middle(tmp_path: Path, mirrored: Mirrored) -> None:
    """Every write gives an input/output error from one moment on: the keeper goes on, and says so once."""
    image = disks.made_image(tmp_path / "image")
    with disks.disk(image, mirrored.state):
        mirrored.stage.write(at(1))
        mirrored.mirror.turn(100.0)
        cut_off(mirrored.state)
        mirrored.stage.write(moved(PLACE, position_s=2.0))
        for turn in range(3):
            mirrored.mirror.turn(110.0 + RETRY_S * turn)
        assert mirrored.mirror.failed == 3 and len(mirrored.said) == 1
    with disks.disk(image, mirrored.state):
        assert mirrored.on_disk == at(1)
        mirrored.mirror.turn(200.0)  # the same process finds the disk that is back
        assert mirrored.on_disk == moved(PLACE, position_s=2.0)


WRITER = """
import sys
from pathlib import Path
from appliance.box.checkpoint import Checkpoint, Standing, packed
from appliance.box.record import SlotFile
file, tick = SlotFile(Path(sys.argv[1])), int(sys.argv[2])
while True:
    tick += 1
    try:
        file.write(packed(Checkpoint("A show", (Standing("main", 1.5, (0.0, 30.0)),), tick=tick)))
    except OSError:
        break
    print(tick, flush=True)
"""


@needs_mounts
def test_power_cuts_at_any_moment_lose_nothing_that_was_synced(tmp_path: Path) -> None:
    """A real ext4 on a real (loop) device, whose power goes while places are written as fast as it takes."""
    image, folder = disks.made_image(tmp_path / "image"), tmp_path / "disk"
    newest = 0
    for cut in range(10):
        with disks.disk(image, folder):
            before = read_checkpoint(folder / "state" / FILE)
            assert cut == 0 or (before is not None and before.tick >= newest)
            command = [sys.executable, "-c", WRITER, str(folder / "state" / FILE), str(newest)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
                assert writer.stdout is not None
                for _ in range(1 + cut * cut):
                    newest = int(writer.stdout.readline())
                cut_off(folder)
                newest = max([newest, *map(int, writer.stdout.read().split())])
