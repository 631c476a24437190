"""The place in memory: written at each tick, read whole or not at all, whatever happens to its writer."""

from __future__ import annotations

import fcntl
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.box import ring_file
from appliance.box.checkpoint import (
    FILE,
    LARGEST,
    Checkpoint,
    CheckpointReader,
    CheckpointWriter,
    Standing,
    boot_id,
    packed,
    unpacked,
)
from appliance.box.ring_file import RingFileWriter
from appliance.pose.possible import FARTHEST_ON_STAGE_M
from tests.standing import moved

PLACE = Checkpoint(
    "Évora, night",
    (Standing("second", 12.34, (1.0, 40.0), (0.25, -1.5, 3.0), (0.01, -0.2), 10, 9, ("lShldr", "rShldr")),),
    -0.5,
    "storm",
    "boot",
    123_456_789,
    3,
    1,
    False,
    2,
)
_finite = st.floats(-FARTHEST_ON_STAGE_M, FARTHEST_ON_STAGE_M)
_names = st.text(max_size=60)


@given(
    st.builds(
        Checkpoint,
        show=_names,
        puppets=st.lists(
            st.builds(
                Standing,
                phrase=_names,
                position_s=_finite,
                excerpt=st.tuples(_finite, _finite),
                standing=st.tuples(_finite, _finite, _finite),
                strayed=st.tuples(_finite, _finite),
                coding=st.integers(1, 64),
                interaction=st.integers(0, 64),
                let_go=st.lists(_names, max_size=4).map(tuple),
                made=st.integers(0, 2000),
            ),
            min_size=1,
            max_size=3,
        ).map(tuple),
        rate=_finite,
        cue=_names,
        tick=st.integers(-1, 2**62),
        restarts=st.integers(0, 65535),
        ended=st.booleans(),
        tries=st.integers(0, 255),
        liveliness=st.tuples(_finite, st.integers(0, 2**31 - 1), st.integers(0, 2**62)),
        motion=st.lists(st.tuples(_names, st.lists(_finite, max_size=4).map(tuple)), max_size=3).map(tuple),
    )
)
def test_comes_back_as_it_was(place: Checkpoint) -> None:
    assert unpacked(packed(place)) == place


def test_numbers_that_are_none_are_no_place() -> None:
    assert unpacked(packed(moved(PLACE, position_s=math.nan))) is None
    assert unpacked(packed(moved(PLACE, strayed=(0.0, math.inf)))) is None
    assert unpacked(packed(replace(PLACE, liveliness=(math.nan, 0, 0)))) is None
    assert unpacked(packed(replace(PLACE, motion=(("motion vary sigma", (math.inf,)),)))) is None


@pytest.mark.parametrize("far", [1.01 * FARTHEST_ON_STAGE_M, -1e30, 1e200])
def test_places_where_no_stage_stands_are_none(far: float) -> None:
    one = PLACE.puppets[0]
    for changes in (
        {"standing": (far, 0.0, 0.0)},
        {"standing": (0.0, far, 0.0)},
        {"strayed": (far, 0.0)},
        {"strayed": (0.0, far)},
    ):
        for puppets in ((one._replace(**changes), one), (one, one._replace(**changes))):
            assert unpacked(packed(replace(PLACE, puppets=puppets))) is None
    assert unpacked(packed(replace(PLACE, liveliness=(0.5, 10**400, 0)))) is None


@pytest.mark.parametrize("length", range(len(packed(PLACE))))
def test_a_part_of_it_is_no_place(length: int) -> None:
    assert unpacked(packed(PLACE)[:length]) is None


def test_counts_that_grow_for_years_still_fit() -> None:
    place = unpacked(packed(replace(PLACE, restarts=10**6)))
    assert place is not None and place.restarts == 65535


def test_names_that_are_too_long_are_refused() -> None:
    with pytest.raises(ValueError, match=str(LARGEST)):
        packed(replace(PLACE, cue="x" * LARGEST))


def test_the_place_counts_for_more_than_what_was_declared_for_the_generator() -> None:
    many = (("motion path points", (0.123456789,) * LARGEST),)
    assert unpacked(packed(replace(PLACE, motion=many))) == PLACE


def test_outlives_its_writer_and_is_written_on_by_the_next(tmp_path: Path) -> None:
    reader = CheckpointReader(tmp_path)
    assert reader.read() is None
    for tick in (1, 2, 3):
        writer = CheckpointWriter(tmp_path)
        writer.write(replace(PLACE, tick=tick))
        assert reader.stage_lives() is (tick > 1)  # the reader has looked at the file once it was there
        assert reader.read() == replace(PLACE, tick=tick)
        assert reader.stage_lives()
        writer.close()
        assert reader.read() == replace(PLACE, tick=tick)
        assert not reader.stage_lives()
    reader.close()


WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from appliance.box.checkpoint import CheckpointWriter, unpacked
PLACE = unpacked(bytes.fromhex(sys.argv[3]))
writer, tick = CheckpointWriter(Path(sys.argv[1])), int(sys.argv[2])
while True:
    tick += 1
    writer.write(replace(PLACE, tick=tick))
    if tick % 1000 == 0:
        print(tick, flush=True)
"""


def test_a_writer_killed_in_the_middle_leaves_the_newest_whole_place(tmp_path: Path) -> None:
    newest = 0
    for _ in range(4):
        command = [sys.executable, "-c", WRITER, str(tmp_path), str(newest), packed(PLACE).hex()]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            try:
                assert writer.stdout is not None
                reported = int(writer.stdout.readline())
            finally:
                writer.send_signal(signal.SIGKILL)
        reader = CheckpointReader(tmp_path)
        place = reader.read()
        reader.close()
        assert place is not None and place.tick >= reported > newest
        assert place == replace(PLACE, tick=place.tick)
        newest = place.tick


def test_who_looks_whether_the_stage_lives_does_not_keep_the_next_one_from_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It holds the file's lock for a moment, and may stand still in that moment."""
    CheckpointWriter(tmp_path).close()
    looking = os.open(tmp_path / FILE, os.O_RDONLY)
    fcntl.flock(looking, fcntl.LOCK_SH)
    waited: list[float] = []

    def sleep(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) == 5:
            fcntl.flock(looking, fcntl.LOCK_UN)

    monkeypatch.setattr(ring_file, "time", SimpleNamespace(sleep=sleep))
    writer = CheckpointWriter(tmp_path)
    assert len(waited) == 5
    with pytest.raises(BlockingIOError):  # that one lives
        CheckpointWriter(tmp_path)
    assert sum(waited) < 0.5
    writer.close()
    os.close(looking)


BEGINNER = """
import os, signal, sys
from pathlib import Path
from appliance.box.ring_file import RingFileWriter
from appliance.pose.possible import FARTHEST_ON_STAGE_M
RingFileWriter.new(Path(sys.argv[1]), "place", 1, [(2, 1000)])
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_writer_never_published_goes_and_no_living_ones_file(tmp_path: Path) -> None:
    path, kind = tmp_path / FILE, [(2, 1000)]
    subprocess.run([sys.executable, "-c", BEGINNER, str(path)], check=False)
    [left] = tmp_path.iterdir()
    assert left.name.startswith(f".{FILE}.")
    living = tmp_path / f".{FILE}.1"
    living.write_bytes(b"")
    others = [tmp_path / f".{FILE}.new", tmp_path / f".{FILE}.old.1", tmp_path / f"{FILE}.1"]
    for other in others:
        other.write_bytes(b"")
    with living.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        file = RingFileWriter.new(path, "place", 1, kind)
        file.publish()
    assert {*tmp_path.iterdir()} == {path, living, *others}
    file.close()


def test_a_writer_whose_file_was_cleared_away_before_it_was_locked_makes_another_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, locked = fcntl.flock, list[int]()

    def flock(descriptor: int, how: int) -> None:
        if not locked:
            [unlocked] = tmp_path.iterdir()
            unlocked.unlink()
        locked.append(descriptor)
        real(descriptor, how)

    monkeypatch.setattr(ring_file, "fcntl", SimpleNamespace(**{**vars(fcntl), "flock": flock}))
    file = RingFileWriter.new(tmp_path / FILE, "place", 1, [(2, 1000)])
    file.publish()
    file.close()
    assert [one.name for one in tmp_path.iterdir()] == [FILE]


def test_every_byte_of_the_file_may_be_wrong(tmp_path: Path) -> None:
    """Whichever byte is: what is read is one of the two newest places, or none; and it can be written on."""
    writer = CheckpointWriter(tmp_path)
    places = [replace(PLACE, tick=tick) for tick in (1, 2)]
    for place in places:
        writer.write(place)
    writer.close()
    path = tmp_path / FILE
    whole = path.read_bytes()
    for at in range(0, len(whole), 31):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        reader = CheckpointReader(tmp_path)
        assert reader.read() in (*places, None)
        reader.close()
    os.truncate(path, 100)
    writer = CheckpointWriter(tmp_path)
    writer.write(PLACE)
    writer.close()
    reader = CheckpointReader(tmp_path)
    assert reader.read() == PLACE
    reader.close()


def test_the_kernel_names_this_start_of_the_machine() -> None:
    assert len(boot_id()) == 36
    assert boot_id() == boot_id()
