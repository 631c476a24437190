"""A stage as the readers of its shared frame see it: fresh, stale, gone, or followed by another one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from appliance.outputs.frame_reader import STALE_S, FrameReader
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from tests.outputs.conftest import write
from tests.outputs.small_stage import NOW, WRITES, facts_of, one_puppet, small


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
