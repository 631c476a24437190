"""The shared frame: frames, facts and health are read as they were written."""

from __future__ import annotations

import dataclasses
import gc
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from appliance.box.ring import Ring
from appliance.box.ring_file import RingFileWriter
from appliance.outputs import shared_frame
from appliance.outputs.frame_layout import FORMAT, FRAME_SLOTS, FrameLayout
from appliance.outputs.frame_reader import STALE_S, FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from tests.outputs.conftest import fill, write
from tests.outputs.small_stage import NOW, NUMBERS, WRITES, facts_of, one_puppet, small


def assert_same(seen: JointFrame | None, frame: JointFrame) -> None:
    assert seen is not None
    for name in ("tick", "frame_time", "late", "sensor_sequence", "sensor_arrival"):
        assert getattr(seen, name) == getattr(frame, name)
    for one, other in zip(seen.puppets, frame.puppets, strict=True):
        for name in NUMBERS:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_frame_is_read_as_it_was_written(tmp_path: Path, skeleton: Skeleton, frame: JointFrame) -> None:
    writer = FrameWriter(tmp_path, facts_of(skeleton), monotonic=lambda: 1000.028)
    frame.late, frame.sensor_sequence, frame.sensor_arrival = True, 2**40, 999.25
    writer.write(frame)
    reader = FrameReader(tmp_path)
    assert_same(reader.newest(NOW), frame)
    seen = reader.newest(NOW)
    assert seen is not None and seen.left == 1000.028
    fill(frame, skeleton, seed=7)
    frame.late, frame.sensor_sequence = False, -1
    writer.write(frame)
    assert_same(reader.newest(NOW), frame)
    assert seen.tick == 1 and seen.late, "what was read before is the reader's own"
    with pytest.raises(ValueError):
        seen.puppets[0].pose[0] = 0.0


def test_the_facts_arrive(writer: FrameWriter, tmp_path: Path, skeleton: Skeleton) -> None:
    found, expected = FrameReader(tmp_path).facts, facts_of(skeleton)
    assert found is not None and found.skeleton.names == skeleton.names
    np.testing.assert_array_equal(found.skeleton.offsets, skeleton.offsets)
    assert found.skeleton.parents == skeleton.parents
    assert dataclasses.replace(found, skeleton=skeleton) == dataclasses.replace(expected, skeleton=skeleton)


def test_the_page_on_outputs_has_the_format_and_every_fact() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "outputs.md").read_text("utf-8")
    assert f"Format {FORMAT}, little-endian." in page
    facts = page.partition("**Facts**, JSON")[2].partition("\n\n")[0]
    names = [field.name for field in dataclasses.fields(shared_frame.Facts)]
    assert [name for name in names if f"`{name}`" not in facts] == []


def test_the_last_frames_come_in_their_order(writer: FrameWriter, tmp_path: Path, skeleton: Skeleton) -> None:
    reader = FrameReader(tmp_path)
    assert reader.frames(5, NOW) == []
    write(writer, skeleton, *range(1, 4))
    assert [frame.tick for frame in reader.frames(5, NOW)] == [1, 2, 3]
    write(writer, skeleton, *range(4, 200))
    later = NOW + 0.02 * 200
    assert [frame.tick for frame in reader.frames(5, later)] == [195, 196, 197, 198, 199]
    everything = [frame.tick for frame in reader.frames(1000, later)]
    assert everything == list(range(200 - FRAME_SLOTS, 200))


def test_health_is_read_as_it_was_written(writer: FrameWriter, tmp_path: Path) -> None:
    reader = FrameReader(tmp_path)
    assert reader.health() is None
    for late in range(5):
        health = {"state": "dancing", "late": late, "sensor_age_s": None, "sensors": [["left", 1, 0.5]]}
        writer.write_health(health)
        assert reader.health() == health


def test_health_that_is_too_long_loses_the_end_of_its_longest_list(
    writer: FrameWriter, tmp_path: Path
) -> None:
    sensors = [[f"sensor-{number}", "x" * 200] for number in range(1000)]
    writer.write_health({"state": "dancing", "sensors": sensors, "receivers": [{"name": "one"}]})
    health = FrameReader(tmp_path).health()
    assert health is not None and health["state"] == "dancing" and health["receivers"] == [{"name": "one"}]
    assert 100 < len(health["sensors"]) < 1000
    assert health["sensors"] == sensors[: len(health["sensors"])]


def test_writing_makes_nothing_for_the_collector(
    writer: FrameWriter, skeleton: Skeleton, frame: JointFrame
) -> None:
    def made_by(times: int) -> int:
        gc.collect()
        gc.disable()
        try:
            before = gc.get_count()[0]
            for _ in range(times):
                writer.write(frame)
            return gc.get_count()[0] - before
        finally:
            gc.enable()

    made_by(100)
    assert made_by(1000) <= made_by(10), "as much as counting itself makes"


def test_a_stage_is_fresh_while_its_frames_are_young(
    writer: FrameWriter, reader: FrameReader, skeleton: Skeleton
) -> None:
    assert reader.state(NOW) == "absent", "no frame yet"
    write(writer, skeleton, 1)  # at 1000.02
    assert reader.state(NOW + 0.02) == "fresh"
    assert reader.state(NOW + 0.02 + STALE_S) == "fresh"
    assert reader.state(NOW + 0.03 + STALE_S) == "stale"
    assert reader.is_alive(NOW + 0.03 + STALE_S), "it may hang"
    assert reader.newest(NOW + 60.0) is not None


def test_a_reader_that_comes_first_finds_the_stage_later(
    tmp_path: Path, reader: FrameReader, skeleton: Skeleton
) -> None:
    assert (reader.state(NOW), reader.newest(NOW), reader.frames(3, NOW)) == ("absent", None, [])
    assert (reader.health(), reader.facts, reader.generation) == (None, None, 0)
    writer = FrameWriter(tmp_path, facts_of(skeleton))
    write(writer, skeleton, 1)
    assert reader.newest(NOW + 0.05) is None, "the file system is asked ten times a second"
    assert reader.state(NOW + 0.11) == "fresh"
    assert reader.generation == 1
    writer.close()


def test_a_show_that_ends_is_absent_and_its_last_frames_stay(
    writer: FrameWriter, reader: FrameReader, tmp_path: Path, skeleton: Skeleton
) -> None:
    write(writer, skeleton, 1, 2)
    assert reader.state(NOW + 0.2) == "fresh"
    writer.close()
    assert list(tmp_path.iterdir()) == []
    assert reader.state(NOW + 0.4) == "absent"
    assert not reader.is_alive(NOW + 0.4)
    assert [frame.tick for frame in reader.frames(5, NOW + 0.4)] == [1, 2]
    assert FrameReader(tmp_path).newest(NOW) is None


def test_another_stage_with_another_skeleton_takes_over(
    writer: FrameWriter, reader: FrameReader, tmp_path: Path, skeleton: Skeleton
) -> None:
    write(writer, skeleton, 1)
    assert reader.state(NOW + 0.2) == "fresh" and reader.generation == 1
    other = FrameWriter(tmp_path, facts_of(small(5)))
    writer.close()
    assert reader.newest(NOW + 0.4) is None and reader.generation == 2
    other.write(one_puppet(5))
    seen = reader.newest(NOW + 0.6)
    assert seen is not None and seen.puppets[0].pose.shape == (5, 4)
    assert reader.facts is not None and len(reader.facts.skeleton) == 5
    other.close()


def test_a_stage_that_is_killed_is_stale_and_the_next_one_is_found(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITES, str(tmp_path), "5", "0.02"]
    reader = FrameReader(tmp_path)
    now = NOW
    for generation in (1, 2):
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as stage:
            try:
                assert stage.stdout is not None and stage.stdout.readline() == "written\n"
                now += 1.0
                assert reader.is_alive(now) and reader.generation == generation
            finally:
                stage.kill()
        now += 1.0
        newest = reader.newest(now)
        assert newest is not None and not reader.is_alive(now)
        assert reader.state(newest.frame_time) == "stale", "however young its last frame is"


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
