"""The keeper and a disk that is full, read-only or gone: said once, tried again, and the newest is kept."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.box.checkpoint import Checkpoint, CheckpointReader, CheckpointWriter
from appliance.box.clock import TICK_S
from appliance.box.ring_file import RingFileWriter
from appliance.box.runtime_folder import Claim
from appliance.keeper.journal_carrier import RETRY_S
from appliance.keeper.keeper import END_S, TURN_S, keep_on
from appliance.keeper.kept import keep_rest
from appliance.recorder.reading import read_journal
from appliance.recorder.segments import LEAST_FREE_SHARE, SEGMENT_TICKS, segment_paths
from appliance.show.box import BoxConfig
from appliance.stage.recorder import FILE, FORMAT, KIND
from tests.bundles import write_show
from tests.fake_clock import FakeTime
from tests.recorder.night import Night

DISK_BYTES = 8 << 20
PLACE = Checkpoint("A show", "main", 1.5, (0.0, 30.0))


@pytest.fixture
def night(tmp_path: Path) -> Night:
    return Night(write_show(tmp_path / "show"), tmp_path / "runtime")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own, of eight megabytes."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounting = ("mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", str(folder))
    if subprocess.run(mounting, capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here (not root, or in a closed container)")
    yield folder
    subprocess.run(("umount", "-l", str(folder)), check=True)


def fill(disk: Path, but: int = 0) -> Path:
    """All the room that is left, but for so many bytes, taken by somebody else."""
    ballast = disk / "ballast"
    with ballast.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            file.truncate(file.tell() - but)
            return ballast


def note(night: Night, ticks: int) -> None:
    """So many ticks that cost no dance; their poses pack no smaller than those of one."""
    noise = np.random.default_rng(0)
    for _ in range(ticks):
        night.tick.frame.pose[...] = noise.random(night.tick.frame.pose.shape)
        night.slot.tick += 1
        night.slot.deadline += TICK_S
        night.slot.started = night.slot.deadline
        night.recorder.note_tick(night.slot, night.tick, 0)
        if night.recorder.wants_keyframe:
            night.recorder.keyframe(night.tick.state())


def test_a_full_disk_is_said_once_and_the_newest_follows_when_there_is_room(night: Night, disk: Path) -> None:
    carrier = night.carrier(disk / "journal")
    night.dance(100)
    carrier.turn(0.0)
    ballast = fill(disk)
    for turn in range(1, 100):
        night.dance(5)
        carrier.turn(float(turn))
    (said,) = night.said
    assert "the journal stops growing (No space left on device)" in said and "Free the disk" in said
    assert carrier.complaint == said
    assert carrier.errors == 1 + int(98 / RETRY_S)
    ballast.unlink()
    carrier.turn(200.0)
    assert carrier.complaint == "" and "grows again" in night.said[1]
    assert read_journal(disk / "journal").ticks["tick"].tolist() == list(range(595))


def test_a_disk_that_becomes_read_only_is_no_reason_to_stop(night: Night, disk: Path) -> None:
    carrier = night.carrier(disk / "journal")
    night.dance(50)
    carrier.turn(0.0)
    carrier._segments.finish()  # nobody writes: it can be remounted
    subprocess.run(("mount", "-o", "remount,ro", str(disk)), check=True)
    night.dance(50)
    carrier.turn(1.0)
    assert "Read-only file system" in carrier.complaint
    subprocess.run(("mount", "-o", "remount,rw", str(disk)), check=True)
    carrier.turn(1.0 + RETRY_S)
    assert read_journal(disk / "journal").ticks["tick"].tolist() == list(range(100))


def test_a_disk_that_is_not_there_is_waited_for(night: Night, tmp_path: Path) -> None:
    (tmp_path / "data").touch()  # nothing can be made below a file
    carrier = night.carrier(tmp_path / "data" / "journal")
    night.dance(50)
    carrier.turn(0.0)
    assert "Not a directory" in carrier.complaint
    (tmp_path / "data").unlink()
    (tmp_path / "data").mkdir()
    carrier.turn(5.0)
    assert carrier.complaint
    carrier.turn(RETRY_S)
    assert not carrier.complaint
    assert len(read_journal(tmp_path / "data" / "journal").ticks) == 50


FOREIGN = {
    "no text": b"\xff\xfe",
    "no object": b"[1]",
    "nothing in it": b"{}",
    "another layout": b'{"record": 3, "run": "x"}',
    "of half a run": b'{"record": [], "run": "x", "joints": []}',
}


@pytest.mark.parametrize("facts", FOREIGN.values(), ids=FOREIGN.keys())
def test_what_another_release_has_noted_is_said_and_the_next_stage_is_kept(
    night: Night, tmp_path: Path, facts: bytes
) -> None:
    with closing(RingFileWriter.new(night.runtime / FILE, KIND, FORMAT, [(1, 500)] * 3)) as other:
        other.rings[0].write(facts)
        other.publish()
        carrier = night.carrier(tmp_path / "journal")
        carrier.turn(0.0)
        assert "not of this release" in carrier.complaint and night.said == [carrier.complaint]
        carrier.turn(RETRY_S)
    stage = Night(night.show.directory, night.runtime)
    stage.dance(30)
    carrier.turn(2 * RETRY_S)
    assert carrier.complaint == ""
    assert len(read_journal(tmp_path / "journal").ticks) == 30


def test_a_memory_of_another_format_is_said_too(night: Night, tmp_path: Path) -> None:
    with closing(RingFileWriter.new(night.runtime / FILE, KIND, FORMAT + 1, [(1, 500)] * 3)) as other:
        other.publish()
        carrier = night.carrier(tmp_path / "journal")
        carrier.turn(0.0)
        assert "Update this program" in carrier.complaint


def test_the_oldest_go_where_room_is_short_but_never_the_newest_minute(night: Night, disk: Path) -> None:
    carrier, folder = night.carrier(disk / "journal"), disk / "journal"
    for second in range(170):
        note(night, 50)
        carrier.turn(float(second))
    assert len(segment_paths(folder)) == 3
    fill(disk, but=int(LEAST_FREE_SHARE * DISK_BYTES) + 100_000)
    for second in range(170, 330):
        note(night, 50)
        carrier.turn(float(second))
        if second % 10 == 9:
            ticks = read_journal(folder).ticks["tick"]
            assert len(ticks) >= SEGMENT_TICKS
    assert int(ticks[0]) > 0 and int(ticks[-1]) == 330 * 50 - 1  # it goes on in the room that the oldest had
    assert night.said == []


def test_the_keeper_turns_until_it_is_stopped_and_then_once_more() -> None:
    time, happened = FakeTime(), list[str]()

    class Carried:
        complaint, fallback = "", "not-kept"

        def turn(self, now: float) -> None:
            happened.append(f"turn at {now - 1000.0:.1f}")

        def last_turn(self) -> None:
            happened.append("last turn")

    keep_on([Carried()], lambda: time.now > 1001.2, lambda now: None, time.monotonic, time.sleep)
    assert happened == ["turn at 0.0", "turn at 0.5", "turn at 1.0", "last turn"]


def end_of(place: CheckpointWriter, runtime: Path, ends_at: float, end_s: float = END_S) -> list[float]:
    """When a keeper that is stopped at 0.7 s turns, the last time at its end; its stage ends at `ends_at`."""
    time, turned = FakeTime(), list[float]()

    class Carried:
        complaint, fallback = "", "not-kept"

        def turn(self, now: float) -> None:
            turned.append(round(now - 1000.0, 2))

        def last_turn(self) -> None:
            self.turn(time.now)

    def sleep(seconds: float) -> None:
        time.sleep(seconds)
        place.write(replace(PLACE, position_s=time.now - 1000.0, ended=time.now > 1000.0 + ends_at))

    place.write(PLACE)
    with closing(CheckpointReader(runtime)) as reader:
        clock = {"monotonic": time.monotonic, "sleep": sleep}
        keep_on([Carried()], lambda: time.now > 1000.69, goes_on=reader.goes_on, end_s=end_s, **clock)
    return turned


def test_a_show_is_carried_to_its_end_which_comes_after_lights_that_fade(tmp_path: Path) -> None:
    """The power may fail meanwhile, and what happens until then belongs into the journal."""
    with closing(CheckpointWriter(tmp_path)) as place:
        turned = end_of(place, tmp_path, ends_at=5.0)
        assert turned[-1] == pytest.approx(5.05, abs=0.06)
        assert max(np.diff(turned)) == pytest.approx(TURN_S)
        assert end_of(place, tmp_path, ends_at=0.2)[-1] == pytest.approx(0.7, abs=0.06)


def test_a_show_that_does_not_end_is_not_waited_for_for_ever(tmp_path: Path) -> None:
    place = CheckpointWriter(tmp_path)
    assert end_of(place, tmp_path, ends_at=99.0)[-1] == pytest.approx(0.7 + END_S, abs=0.06)
    assert end_of(place, tmp_path, ends_at=99.0, end_s=1.0)[-1] == pytest.approx(1.7, abs=0.06)
    place.write(PLACE)
    place.close()
    with closing(CheckpointReader(tmp_path)) as reader:
        assert not reader.goes_on(), "the stage is gone: nobody will say that its show has ended"


def test_whatever_the_disk_takes_each_is_given_the_time_at_which_it_begins() -> None:
    """A beat with the time from before a slow disk would tell of a keeper that died."""
    time, begun, beats = FakeTime(), list[float](), list[float]()

    class Slow:
        complaint, fallback = "", "not-kept"

        def turn(self, now: float) -> None:
            begun.append(now)
            time.work(2.0)

        def last_turn(self) -> None:
            pass

    keep_on([Slow(), Slow()], lambda: time.now > 1005.0, beats.append, time.monotonic, time.sleep)
    assert begun == [1000.0, 1002.0, 1004.0, 1006.0]
    assert beats == [1004.0, 1008.0]


def test_what_a_keeper_did_not_live_to_carry_is_carried_after_the_dance(night: Night, tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    night.dance(40)
    box = BoxConfig()
    with closing(Claim(tmp_path / "runtime", "keeper")):
        keep_rest(box, tmp_path / "runtime", journal, 1.0, print)
        assert not journal.exists()  # a keeper that is there does it itself
    for _ in range(2):
        keep_rest(box, tmp_path / "runtime", journal, 1.0, print)
        assert len(read_journal(journal).ticks) == 40
    assert len(segment_paths(journal)) == 1
