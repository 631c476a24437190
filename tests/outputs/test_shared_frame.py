"""The shared frame: frames, facts and health are read as they were written."""

from __future__ import annotations

import dataclasses
import gc
from pathlib import Path

import numpy as np
import pytest

from appliance.outputs.frame_layout import FRAME_SLOTS
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from tests.outputs.conftest import fill, write
from tests.outputs.small_stage import NOW, NUMBERS, facts_of


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
