"""Emulated hands: unit orientations, the pace that was asked for, and never faster than the box believes."""

from __future__ import annotations

from itertools import pairwise
from math import acos, degrees, radians
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from hw_sim import motions
from hw_sim.motions import Motion
from hw_sim.traces import TraceError, read_trace


def degrees_between(a: motions.Quaternion, b: motions.Quaternion) -> float:
    return degrees(2 * acos(min(1.0, abs(sum(p * q for p, q in zip(a, b, strict=True))))))


def fastest_degrees_s(motion: Motion, seconds: float = 60.0) -> float:
    path = [motion(n * 0.02) for n in range(int(seconds * 50))]
    assert all(sum(part * part for part in q) == pytest.approx(1.0) for q in path)
    return max(degrees_between(a, b) for a, b in pairwise(path)) * 50


def test_turning_keeps_its_pace_and_direction() -> None:
    motion = motions.turning((0, 2, 0), 4.0)
    assert motion(1.0) == pytest.approx(motions.about((0, 1, 0), radians(90)))
    assert fastest_degrees_s(motion) == pytest.approx(90, abs=0.1)
    assert motions.turning((0, 1, 0), -4.0)(1.0) == pytest.approx(motions.about((0, 1, 0), radians(-90)))


def test_still_is_still() -> None:
    assert fastest_degrees_s(motions.still()) == 0


def test_a_dance_moves_smoothly_and_repeats_only_with_its_seed() -> None:
    assert 100 < fastest_degrees_s(motions.dance(1), 300) < 800
    assert motions.dance(1)(12.3) == motions.dance(1)(12.3)
    assert motions.dance(1)(12.3) != motions.dance(2)(12.3)


def test_a_step_jumps_at_once_at_its_time() -> None:
    motion = motions.step(degrees=30, every_s=0.5)
    assert degrees_between(motion(0.49), motion(0.5)) == pytest.approx(30)
    assert motion(0.5) == motion(0.99)
    assert motion(1.0) == motion(0.0)


def test_what_cannot_be_moved_is_refused() -> None:
    with pytest.raises(ValueError, match="faster than any hand"):
        motions.step(degrees=90)
    with pytest.raises(ValueError, match="length zero"):
        motions.turning((0, 0, 0))
    with pytest.raises(ValueError, match="stand still"):
        motions.turning(seconds_per_turn=0)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_trace_plays_there_and_back_without_a_jump(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    rows = [f"{5 + n * 0.1},{','.join(map(str, motions.about((1, 0, 0), 0.1 * n)))}" for n in range(21)]
    path.write_text("time_s,w,x,y,z\n" + "\n".join(rows) + "\n", encoding)
    motion = read_trace(path)
    assert motion(0.0) == pytest.approx((1, 0, 0, 0))
    assert motion(1.05) == pytest.approx(motions.about((1, 0, 0), 1.05), abs=1e-4)
    assert motion(2.5) == pytest.approx(motions.about((1, 0, 0), 1.5), abs=1e-4)
    assert fastest_degrees_s(motion, 20) == pytest.approx(degrees(1.0), rel=0.01)


def test_a_joint_of_a_recording(tmp_path: Path) -> None:
    skeleton = Skeleton(("hips", "arm"), (-1, 0), np.array([[0, 0, 0], [0, 0.5, 0]]), ())
    poses = np.tile(quaternion.IDENTITY, (51, 2, 1))
    poses[:, 1] = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.linspace(0, 1, 51))
    path = tmp_path / "arm.bvh"
    write_bvh(path, Recording(skeleton, poses, np.zeros((51, 3)), 50.0))
    assert read_trace(path, "arm")(0.5) == pytest.approx(motions.about((0, 0, 1), 0.5), abs=1e-4)
    with pytest.raises(TraceError, match="'arm'"):
        read_trace(path, "amr")
    with pytest.raises(TraceError, match="--joint"):
        read_trace(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", ":1: a trace needs a header"),
        ("", ":1: a trace needs a header"),
        ("t,w,x,y,z\n0,1,0,0,0\n1,1,0,zero,0\n", ":3: time and orientation"),
        ("t,w,x,y,z\n0,1,0,0,0\n1,1,0\n", ":3: time and orientation"),
        ("t,w,x,y,z\n0,1,0,0,0\n1,0,0,0,0\n", ":3: this is no orientation"),
        ("t,w,x,y,z\n0,1,0,0,0\n1,nan,0,0,0\n", ":3: this is no orientation"),
        ("t,w,x,y,z\n0,1,0,0,0\n", "at least two"),
        ("t,w,x,y,z\n1,1,0,0,0\n1,1,0,0,0\n", "must rise"),
    ],
)
def test_a_broken_trace_says_where_and_what(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "trace.csv"
    path.write_text(text)
    with pytest.raises(TraceError, match=message):
        read_trace(path)


def test_no_trace_at_all() -> None:
    with pytest.raises(TraceError, match="--trace"):
        read_trace(None)
