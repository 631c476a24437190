"""The keeper and a disk that is full, read-only or gone: said once, tried again, and the newest is kept."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.box import mounts
from appliance.box.checkpoint import Checkpoint, CheckpointReader, CheckpointWriter, Standing
from appliance.box.clock import TICK_S
from appliance.box.mounts import memory_of
from appliance.box.process_health import ProcessHealth
from appliance.box.ring_file import RingFileWriter
from appliance.box.runtime_folder import Claim
from appliance.cli.sensors.box_keys import forgotten
from appliance.keeper.fallback import JOURNAL_STOPPED, SAVED_IN_MEMORY
from appliance.keeper.keeper import END_S, KeeperHealth, keep_rest
from appliance.keeper.mirror import RETRY_S, TURN_S, Mirror, mirror_until
from appliance.keeper.mirror_process import HANGS_S, STUCK_S, MirrorProcess
from appliance.recorder.journal_reader import read_journal
from appliance.recorder.segments import LEAST_FREE_SHARE, SEGMENT_TICKS, segment_paths
from appliance.show.box import BoxConfig
from appliance.stage.recorder import FILE, FORMAT, KIND
from tests.box import disks
from tests.bundles import write_show
from tests.fake_clock import FakeTime
from tests.logged import said
from tests.recorder.night import Night
from tests.show_control.doubles import until
from tests.standing import moved

DISK_BYTES = 8 << 20
PLACE = Checkpoint("A show", (Standing("main", 1.5, (0.0, 30.0)),))


@pytest.fixture
def night(tmp_path: Path) -> Night:
    return Night(write_show(tmp_path / "show"), tmp_path / "runtime")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own, of eight megabytes."""
    with disks.tiny(tmp_path / "disk", str(DISK_BYTES)) as folder:
        yield folder


def note(night: Night, ticks: int) -> None:
    """This many ticks that cost no dance; their poses pack no smaller than those of one."""
    noise = np.random.default_rng(0)
    for _ in range(ticks):
        night.tick.frame.puppets[0].pose[...] = noise.random(night.tick.frame.puppets[0].pose.shape)
        night.slot.tick += 1
        night.slot.deadline += TICK_S
        night.slot.started = night.slot.deadline
        night.recorder.note_tick(night.slot, night.tick, 0)
        if night.recorder.wants_keyframe:
            night.recorder.keyframe(night.tick)


def test_a_full_disk_is_said_once_and_the_newest_follows_when_there_is_room(night: Night, disk: Path) -> None:
    mirror = night.mirror(disk / "journal")
    night.dance(100)
    mirror.turn(0.0)
    ballast = disks.fill(disk)
    for turn in range(1, 100):
        night.dance(5)
        mirror.turn(float(turn))
    (said,) = night.said
    assert "the journal stops growing (No space left on device)" in said and "Free the disk" in said
    assert mirror.complaint == said
    assert mirror.failed == 1 + int(98 / RETRY_S)
    ballast.unlink()
    mirror.turn(200.0)
    assert mirror.complaint == "" and "grows again" in night.said[1]
    assert read_journal(disk / "journal").ticks["tick"].tolist() == list(range(595))


def test_a_disk_that_becomes_read_only_is_no_reason_to_stop(night: Night, disk: Path) -> None:
    mirror = night.mirror(disk / "journal")
    night.dance(50)
    mirror.turn(0.0)
    mirror._mirrored._segments.finish()  # nobody writes: it can be remounted
    subprocess.run(("mount", "-o", "remount,ro", str(disk)), check=True)
    night.dance(50)
    mirror.turn(1.0)
    assert "Read-only file system" in mirror.complaint
    subprocess.run(("mount", "-o", "remount,rw", str(disk)), check=True)
    mirror.turn(1.0 + RETRY_S)
    assert read_journal(disk / "journal").ticks["tick"].tolist() == list(range(100))


def test_a_disk_that_is_not_there_is_waited_for(night: Night, tmp_path: Path) -> None:
    (tmp_path / "data").touch()  # nothing can be made below a file
    mirror = night.mirror(tmp_path / "data" / "journal")
    night.dance(50)
    mirror.turn(0.0)
    assert "Not a directory" in mirror.complaint
    (tmp_path / "data").unlink()
    (tmp_path / "data").mkdir()
    mirror.turn(5.0)
    assert mirror.complaint
    mirror.turn(RETRY_S)
    assert not mirror.complaint
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
        mirror = night.mirror(tmp_path / "journal")
        mirror.turn(0.0)
        assert "not of this release" in mirror.complaint and night.said == [mirror.complaint]
        mirror.turn(RETRY_S)
    stage = Night(night.show.directory, night.runtime)
    stage.dance(30)
    mirror.turn(2 * RETRY_S)
    assert mirror.complaint == ""
    assert len(read_journal(tmp_path / "journal").ticks) == 30


def test_a_stage_of_another_release_after_one_of_this_release_is_said(night: Night, tmp_path: Path) -> None:
    mirror = night.mirror(tmp_path / "journal")
    night.dance(30)
    mirror.turn(0.0)
    with closing(RingFileWriter.new(night.runtime / FILE, KIND, FORMAT + 1, [(1, 500)] * 3)) as other:
        other.publish()
        for turn in (1, 2):  # the second one read on in a file that was closed
            mirror.turn(turn * RETRY_S)
            assert "Update this program" in mirror.complaint
    assert len(read_journal(tmp_path / "journal").ticks) == 30


def test_a_memory_of_another_format_is_said_too(night: Night, tmp_path: Path) -> None:
    with closing(RingFileWriter.new(night.runtime / FILE, KIND, FORMAT + 1, [(1, 500)] * 3)) as other:
        other.publish()
        mirror = night.mirror(tmp_path / "journal")
        mirror.turn(0.0)
        assert "Update this program" in mirror.complaint


def test_the_oldest_go_where_room_is_short_but_never_the_newest_minute(night: Night, disk: Path) -> None:
    mirror, folder = night.mirror(disk / "journal"), disk / "journal"
    for second in range(170):
        note(night, 50)
        mirror.turn(float(second))
    assert len(segment_paths(folder)) == 3
    disks.fill(disk, but=int(LEAST_FREE_SHARE * DISK_BYTES) + 100_000)
    for second in range(170, 330):
        note(night, 50)
        mirror.turn(float(second))
        if second % 10 == 9:
            ticks = read_journal(folder).ticks["tick"]
            assert len(ticks) >= SEGMENT_TICKS
    assert int(ticks[0]) > 0 and int(ticks[-1]) == 330 * 50 - 1  # it goes on in the room that the oldest had
    assert night.said == []


class Copied:
    """Anything that is mirrored; `copy` is the test's."""

    name, fallback, recovered = "A thing", JOURNAL_STOPPED, "It is kept again."

    def __init__(self, copy: Callable[[float], None]) -> None:
        self.copy, self.is_closed = copy, False

    def explain(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        self.is_closed = True


def test_a_mirror_turns_until_it_is_stopped_and_then_once_more() -> None:
    time, copied_at = FakeTime(), list[float]()
    copied = Copied(lambda now: copied_at.append(round(now - 1000.0, 1)))
    clock = {"monotonic": time.monotonic, "sleep": time.sleep}
    mirror_until(lambda: time.now > 1001.2, Mirror(copied), lambda: False, END_S, **clock)
    assert copied_at[:3] == [0.0, 0.5, 1.0] and len(copied_at) == 4
    assert copied.is_closed


def test_an_error_is_said_once_and_tried_again_later() -> None:
    copied_at, errors = list[float](), [OSError("Full."), ValueError("Too long."), None]

    def copy(now: float) -> None:
        copied_at.append(now)
        if error := errors[0]:
            raise error

    mirror = Mirror(Copied(copy))
    for now in range(100):
        mirror.turn(float(now))
        if now in (39, 69):
            errors.pop(0)
    assert said == ["Full.", "Too long.", "It is kept again."]
    assert copied_at == [*np.arange(0.0, 70.0, RETRY_S), *range(70, 100)]
    assert (mirror.failed, mirror.complaint) == (7, "")


def end_of(place: CheckpointWriter, runtime: Path, ends_at: float, end_s: float = END_S) -> list[float]:
    """When a mirror that is stopped at 0.7 s turns, the last time at its end; its stage ends at `ends_at`."""
    time, turned = FakeTime(), list[float]()
    mirror = Mirror(Copied(lambda now: turned.append(round(now - 1000.0, 2))))

    def sleep(seconds: float) -> None:
        time.sleep(seconds)
        place.write(moved(PLACE, position_s=time.now - 1000.0, ended=time.now > 1000.0 + ends_at))

    place.write(PLACE)
    with closing(CheckpointReader(runtime)) as reader:
        clock = {"monotonic": time.monotonic, "sleep": sleep}
        mirror_until(lambda: time.now > 1000.69, mirror, reader.goes_on, end_s, **clock)
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


def test_what_a_keeper_did_not_live_to_carry_is_carried_after_the_dance(night: Night, tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    night.dance(40)
    box = BoxConfig()
    with closing(Claim(tmp_path / "runtime", "keeper")):
        keep_rest(box, tmp_path / "runtime", journal, 1.0)
        assert not journal.exists()  # a keeper that is there does it itself
    for _ in range(2):
        keep_rest(box, tmp_path / "runtime", journal, 1.0)
        assert len(read_journal(journal).ticks) == 40
    assert len(segment_paths(journal)) == 1


OVERLAY = (
    "22 1 0:25 / /media/root-rw rw,relatime - tmpfs tmpfs-root rw\n"
    "23 1 0:24 / / rw,relatime shared:1 - overlay overlayroot "
    "rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay,workdir=/media/root-rw/overlay-workdir\n"
)
PARTITION = "24 23 179:3 / /data rw,noatime shared:2 - ext4 /dev/mmcblk0p3 rw\n"
STATE = Path("/data/bunraku/state")


def lay_mounts(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "mountinfo").write_text(text)
    monkeypatch.setattr(mounts, "MOUNTINFO", folder / "mountinfo")


@pytest.mark.parametrize(("text", "memory"), [(OVERLAY, "overlay (/)"), (OVERLAY + PARTITION, ""), ("", "")])
def test_a_box_that_keeps_everything_in_memory_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, memory: str
) -> None:
    lay_mounts(tmp_path, text, monkeypatch)
    assert memory_of(STATE) == memory
    keeper = KeeperHealth(tmp_path, STATE)
    keeper.report([], 10.0)
    reported = [one for _, one in ProcessHealth(tmp_path).fallbacks(10.0)]
    assert [(one.name, one.active, one.about) for one in reported] == (
        [(SAVED_IN_MEMORY.name, True, memory)] if memory else []
    )
    assert bool(memory) == ("gone at power-off" in forgotten(Path("/data/bunraku/keys/sensors.keys")))
    keeper.end(11.0)


def test_a_box_that_nobody_installed_may_keep_things_where_it_likes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lay_mounts(tmp_path, OVERLAY, monkeypatch)
    keeper = KeeperHealth(tmp_path)
    keeper.report([], 10.0)
    assert ProcessHealth(tmp_path).fallbacks(10.0) == []
    keeper.end(11.0)


def test_disks_are_named_as_people_find_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lay_mounts(
        tmp_path, OVERLAY + PARTITION + "25 23 8:1 / /mnt/a\\040disk rw - ext4 /dev/sda1 rw\n", monkeypatch
    )
    assert mounts.disk_of(STATE) == "mmcblk0p3 (/data)"
    assert mounts.disk_of(Path("/mnt/a disk/journal")) == "sda1 (/mnt/a disk)"
    assert mounts.disk_of(Path("/home")) == "overlay (/)"


STEP_S = 0.5


class Stuck:
    """Its first copy never ends."""

    name, fallback, recovered = "A thing", JOURNAL_STOPPED, ""

    def __init__(self, path: Path) -> None:
        self._path = path

    def copy(self, now: float) -> None:
        with self._path.open("a") as file:
            file.write("turn\n")
        signal.pause()

    def explain(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        pass


class Watched:
    """The process of one that is stuck, and what was said of it."""

    def __init__(self, folder: Path) -> None:
        self.now, self.said, self._turns = 1000.0, said, folder / "turns"
        self.process = MirrorProcess(Stuck(self._turns), folder, 0.0)

    @property
    def turns(self) -> int:
        return len(self._turns.read_text().splitlines()) if self._turns.exists() else 0

    def look_for(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now += STEP_S
            self.process.supervise(self.now)

    def goes_on(self) -> bool:
        """With the clock standing still: a start that takes long is no second silence."""
        self.process.supervise(self.now)
        return self.turns == 2


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    watched = Watched(tmp_path)
    watched.look_for(STEP_S)
    until(lambda: watched.turns == 1)
    yield watched
    watched.process.abandon()


def test_what_hangs_is_told_after_a_while_and_started_again_in_the_end(watched: Watched) -> None:
    watched.look_for(HANGS_S - STEP_S)
    assert watched.process.complaint == "" and watched.said == []
    watched.look_for(2 * STEP_S)
    assert "has not answered for 5 s" in watched.process.complaint
    watched.look_for(STUCK_S - HANGS_S - 2 * STEP_S)
    time.sleep(0.2)
    assert watched.turns == 1
    watched.look_for(3 * STEP_S)
    until(watched.goes_on)
    assert len(watched.said) == 2
    assert "has died" in watched.said[1]


def test_a_keeper_that_was_held_up_itself_blames_no_disk(watched: Watched) -> None:
    watched.now += 1000.0
    watched.process.supervise(watched.now)
    assert watched.process.complaint == ""
