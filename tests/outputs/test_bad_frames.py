"""Readers see whole frames or none: torn, cut short, of another time, or in a file that is none of ours."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from appliance.box.ring import Ring
from appliance.box.ring_file import RingFileWriter
from appliance.outputs import shared_frame
from appliance.outputs.frame_layout import FRAME_SLOTS, FrameLayout
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from tests.outputs.conftest import write
from tests.outputs.small_stage import NOW, WRITES, facts_of, one_puppet, small

READS = """
import sys, time
from pathlib import Path
import numpy as np
from appliance.outputs.frame_reader import FrameReader
from tests.outputs.small_stage import NUMBERS
reader, seen, torn, oldest, last = FrameReader(Path(sys.argv[1])), 0, 0, 0, 0
until = time.monotonic() + float(sys.argv[2])
give_up = until + 20.0
while (now := time.monotonic()) < until or ((seen <= 1000 or not oldest) and now < give_up):
    frames = reader.frames(64, time.monotonic())
    newest = reader.newest(time.monotonic())
    oldest += len(frames) < 64
    for frame in (*frames, newest):
        seen += 1
        for name in NUMBERS:
            torn += not (getattr(frame.puppets[0], name) == frame.tick % 65536).all()
        torn += frame.frame_time != 1e-6 * frame.tick
    torn += newest.tick < last
    last = newest.tick
print(seen, torn, oldest)
"""


def frames_ring(path: Path, skeleton: Skeleton) -> Ring:
    """Where the frames lie in the file, worked out from its end."""
    ring = Ring(0, FRAME_SLOTS, FrameLayout(len(skeleton)).bytes)
    return dataclasses.replace(ring, at=path.stat().st_size - ring.end)


def test_a_torn_frame_is_never_shown(
    writer: FrameWriter, tmp_path: Path, skeleton: Skeleton, reader: FrameReader
) -> None:
    """Whichever byte of a slot is not of this frame, the frame before is the newest one."""
    write(writer, skeleton, 1, 2, 3)
    path = tmp_path / shared_frame.FILE
    ring = frames_ring(path, skeleton)
    whole = path.read_bytes()
    random = np.random.default_rng(1)
    used = 16 + ring.capacity
    for place in (0, 7, 8, 12, 15, ring.slot_bytes - 8, *random.integers(16, used, 100)):
        torn = bytearray(whole)
        torn[ring.slot_at(3) + int(place)] ^= 0x10
        path.write_bytes(torn)
        seen = reader.newest(NOW + 1.0)
        assert seen is not None and seen.tick == 2
        assert [frame.tick for frame in reader.frames(3, NOW + 1.0)] == [1, 2]
    path.write_bytes(whole)
    seen = reader.newest(NOW + 1.0)
    assert seen is not None and seen.tick == 3


def test_hammered_by_a_writer_no_reader_ever_takes_a_torn_frame(tmp_path: Path) -> None:
    """Without a pause some ten thousand frames a second go through the ring: slots are overwritten while
    they are read. Each frame's numbers are its tick's, so that a mixture would show.
    """
    with subprocess.Popen(
        [sys.executable, "-c", WRITES, str(tmp_path), "43", "0"], stdout=subprocess.PIPE, text=True
    ) as writer:
        try:
            assert writer.stdout is not None and writer.stdout.readline() == "written\n"
            readers = [
                subprocess.Popen(
                    [sys.executable, "-c", READS, str(tmp_path), "1.5"], stdout=subprocess.PIPE, text=True
                )
                for _ in range(3)
            ]
            reported = [tuple(map(int, reader.communicate()[0].split())) for reader in readers]
        finally:
            writer.kill()
    assert all(torn == 0 for _, torn, _ in reported), reported
    assert all(seen > 1000 for seen, _, _ in reported), reported
    assert any(overtaken for _, _, overtaken in reported), "the writer was never faster: this proved nothing"


@pytest.mark.parametrize("content", [b"", b"x" * 100_000])
def test_a_file_that_is_none_of_ours_is_named_and_nothing_raises(tmp_path: Path, content: bytes) -> None:
    (tmp_path / shared_frame.FILE).write_bytes(content)
    reader = FrameReader(tmp_path)
    assert (reader.newest(NOW), reader.frames(3, NOW), reader.health()) == (None, [], None)
    assert reader.state(NOW) == "absent"
    assert "the stage (bunraku play)" in reader.complaint


def test_facts_that_make_no_sense_are_named(tmp_path: Path) -> None:
    for facts in (b"", b"{}", b"[1]", b'{"skeleton": 3, "box_file": null}'):
        file = RingFileWriter.new(
            tmp_path / shared_frame.FILE, shared_frame.KIND, shared_frame.FORMAT, [(1, 100), (2, 9), (64, 9)]
        )
        file.rings[0].write(facts)
        file.publish()
        reader = FrameReader(tmp_path)
        assert reader.newest(NOW) is None and reader.facts is None
        assert "holds no facts about a show. Start the stage (bunraku play) again." in reader.complaint
        file.close()


@pytest.mark.parametrize(
    ("theirs", "who"), [(shared_frame.FORMAT + 1, "this program"), (0, "the stage (bunraku play)")]
)
def test_another_format_says_which_side_to_update(tmp_path: Path, theirs: int, who: str) -> None:
    file = RingFileWriter.new(tmp_path / shared_frame.FILE, shared_frame.KIND, theirs, [(1, 9)])
    file.publish()
    reader = FrameReader(tmp_path)
    assert reader.state(NOW) == "absent" and reader.newest(NOW) is None
    assert f"Update {who}: both must come from one release." in reader.complaint
    file.close()


def test_a_file_cut_short_under_a_reader_does_no_harm(
    writer: FrameWriter, tmp_path: Path, skeleton: Skeleton
) -> None:
    """Memory that is mapped would be a bus error; readers ask the file instead."""
    write(writer, skeleton, *range(1, 70))
    copy = tmp_path / "copy"
    copy.mkdir()
    path = copy / shared_frame.FILE
    path.write_bytes((tmp_path / shared_frame.FILE).read_bytes())
    reader = FrameReader(copy)
    ring = frames_ring(path, skeleton)
    for length in (ring.slot_at(69) + 10, ring.slot_at(64), ring.at + 3, 0):
        os.truncate(path, length)
        seen = reader.newest(NOW + 1.0)
        assert seen is None or seen.tick < 69
        assert reader.health() is None
    assert reader.newest(NOW + 1.0) is None


@pytest.mark.parametrize("part", ["pose", "world", "positions", "root"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_frame_that_is_not_a_number_is_nobodys(tmp_path: Path, part: str, value: float) -> None:
    writer, reader, frame = FrameWriter(tmp_path, facts_of(small(3))), FrameReader(tmp_path), one_puppet(3)
    frame.tick = 1
    writer.write(frame)
    getattr(frame.puppets[0], part)[-1] = value
    frame.tick = 2
    writer.write(frame)
    assert reader.newest(NOW) is None
    assert [seen.tick for seen in reader.frames(5, NOW)] == [1]
    reader.close()
    writer.close()


def test_a_frame_left_from_before_the_machine_started_anew_is_nobodys(tmp_path: Path) -> None:
    """In a folder on a disk, after a power cut: its times are still to come, and it would count as fresh."""
    writer, frame = FrameWriter(tmp_path, facts_of(small(3))), one_puppet(3)
    frame.frame_time = NOW
    writer.write(frame)
    reader = FrameReader(tmp_path, lambda: 60.0)
    assert reader.newest(NOW - 0.1) is not None  # a picture is drawn for a time a little before
    assert reader.newest(60.0) is None
    assert reader.frames(5, 60.0) == []
    reader.close()
    writer.close()
