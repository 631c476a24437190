"""Between ticks poses are interpolated, one tick behind the stage or predicted; gaps are not filled."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.projector.interpolation import TICK_S, TRAIL_S, Interpolation
from appliance.projector.prediction import CONFIDENCE, REST

WAY_S = 0.004  # from a frame's time to its leaving the stage
TURN = 2.0  # radians a second
SPEED = 3.0  # metres a second


def frame(tick: int, frame_time: float, left: float) -> JointFrame:
    """Everything moves evenly with time, so that the right pose at any time is known."""
    world = quaternion.from_axis_angle([0, 1, 0], np.array([TURN * frame_time] * 2)).astype(np.float32)
    positions = np.full((2, 3), SPEED * frame_time, np.float32)
    holds = np.array([0.0, tick % 2], np.float32)
    puppet = PuppetFrame(positions[0], world, world, world, positions, holds)
    return JointFrame((puppet,), tick, frame_time, left=left)


@dataclass
class Ring:
    """What a reader would read: frames that have left the stage by now, the newest 64 of them."""

    frames_to_come: list[JointFrame] = field(default_factory=list)
    facts = SimpleNamespace(skeleton=Skeleton(("hip", "neck"), (-1, 0), np.zeros((2, 3))))

    def frames(self, count: int, now: float) -> list[JointFrame]:
        there = [one for one in self.frames_to_come if one.left <= now]
        return there[-min(count, 64) :]


def stage(ticks: range | list[int], way_s: float = WAY_S, start: float = 10.0) -> Ring:
    return Ring([frame(tick, start + tick * TICK_S, start + tick * TICK_S + way_s) for tick in ticks])


def following(ring: Ring, prediction_s: float = 0.0) -> Interpolation:
    return Interpolation(ring, prediction_s)  # type: ignore[arg-type]


def shown_times(poses: Interpolation, times: np.ndarray) -> np.ndarray:
    """At which time of the dance each picture shows the dancer, by where the dancer is."""
    found = []
    for now in times:
        poses.take(now)
        moment = poses.moment(now)
        assert moment is not None
        (puppet,) = moment.puppets
        found.append(puppet.positions[0, 0] / SPEED)
        angle = quaternion.angle_between(
            puppet.world[0], quaternion.from_axis_angle([0, 1, 0], TURN * found[-1]).astype(np.float32)
        )
        assert angle < 1e-3
    return np.array(found)


@pytest.mark.parametrize("rate", [24, 50, 60, 120])
def test_motion_is_even_and_exactly_one_tick_behind_what_has_left_the_stage(rate: int) -> None:
    times = np.arange(11.0, 13.0, 1 / rate)
    shown = shown_times(following(stage(range(200))), times)
    assert shown == pytest.approx(times - TICK_S - WAY_S, abs=2e-5)


@pytest.mark.parametrize("prediction_s", [0.005, 0.01, 0.02])
def test_predicted_motion_is_even_and_further_on(prediction_s: float) -> None:
    times = np.arange(11.0, 13.0, 1 / 60)
    shown = shown_times(following(stage(range(200)), prediction_s), times)
    wanted = times - TICK_S - WAY_S + CONFIDENCE * REST * prediction_s  # no hand holds the root
    assert shown == pytest.approx(wanted, abs=1e-4)


def test_frames_after_a_gap_are_shown_as_they_are() -> None:
    ring = stage([*range(100), *range(110, 114)])
    poses = following(ring, 0.02)
    for now in 10.5 + np.arange(0.0, 2.0, 0.01):
        poses.take(now)
    moment = poses.moment(12.5)
    assert moment is not None
    assert moment.puppets[0].positions[0, 0] == ring.frames_to_come[-1].puppets[0].positions[0, 0]


def test_nothing_before_the_first_frame_and_the_first_one_alone() -> None:
    poses = following(stage([0]))
    poses.take(9.0)
    assert poses.moment(9.0) is None and poses.newest is None
    poses.take(10.01)
    moment = poses.moment(10.01)
    assert moment is not None and moment.puppets[0].positions[0, 0] / SPEED == pytest.approx(10.0, abs=1e-5)
    assert moment.time_s == 0.0 and moment.trail_times == [0.0]


def test_a_late_frame_is_waited_for_not_guessed() -> None:
    ring = stage(range(200))
    ring.frames_to_come[100] = frame(100, 12.0, 12.018)  # it left late
    times = np.arange(11.0, 13.0, 1 / 240)
    shown = shown_times(following(ring), times)
    assert (np.diff(shown) >= -1e-5).all()
    assert (shown <= times - TICK_S + 1e-5).all()  # never a pose that the stage has not sent
    held = (times > 12.006) & (times < 12.017)
    assert np.ptp(shown[held]) < 0.011


def test_over_a_gap_the_last_pose_holds_and_the_next_one_follows() -> None:
    ring = stage([*range(50), *range(75, 150)])  # half a second is missing
    times = np.arange(10.5, 12.5, 1 / 60)
    shown = shown_times(following(ring), times)
    in_the_gap = (times > 11.01) & (times < 11.5)
    assert shown[in_the_gap] == pytest.approx(10.98, abs=1e-4)
    assert not ((shown > 10.981) & (shown < 11.499)).any()
    after = times > 11.6
    assert shown[after] == pytest.approx(times[after] - TICK_S - WAY_S, abs=1e-4)


def test_when_the_stage_stops_the_last_pose_stays() -> None:
    shown = shown_times(following(stage(range(50))), np.arange(10.9, 14.0, 1 / 60))
    assert shown[-1] == pytest.approx(10.98, abs=1e-4)


def test_a_display_that_stood_still_reads_what_it_missed() -> None:
    poses = following(stage(range(200)))
    poses.take(10.5)
    poses.take(11.5)
    moment = poses.moment(11.5)
    assert moment is not None
    assert np.diff(moment.trail_times) == pytest.approx(TICK_S)


def test_the_trail_is_the_last_moments_newest_last() -> None:
    poses = following(stage(range(200)))
    for now in np.arange(11.0, 13.0, 1 / 60):
        poses.take(now)
    moment = poses.moment(13.0)
    assert moment is not None
    assert moment.trail_times[-1] <= moment.time_s < moment.trail_times[-1] + TICK_S
    assert TRAIL_S - TICK_S < moment.time_s - moment.trail_times[0] <= TRAIL_S
    for when, (positions, world) in zip(moment.trail_times, moment.puppets[0].trail, strict=True):
        assert positions[0, 0] / SPEED == pytest.approx(10.0 + when, abs=1e-5)
        assert world.shape == (2, 4)


def test_two_boxes_draw_the_same_moment() -> None:
    """Whenever each was switched on: cameras, haze and dust move with the dance's own time."""
    found = []
    for start in (10.0, 5000.0):
        poses = following(stage(range(200), start=start), 0.02)
        for now in start + np.arange(1.0, 3.0, 1 / 60):
            poses.take(now)
        moment = poses.moment(start + 2.503)
        assert moment is not None
        found.append((moment.time_s, *moment.trail_times))
    assert found[0] == pytest.approx(found[1], abs=1e-6)
    assert found[0][0] == pytest.approx(2.503 - WAY_S, abs=1e-6), "one tick behind, 20 ms ahead"


def test_a_slower_stage_is_followed_so_slowly_that_it_cannot_be_seen() -> None:
    ring = stage(range(100))
    ring.frames_to_come += stage(range(100, 300), way_s=0.012).frames_to_come
    times = np.arange(11.0, 15.9, 1 / 60)
    shown = shown_times(following(ring), times)
    assert shown[-1] == pytest.approx(times[-1] - TICK_S - 0.012, abs=1e-4)
    assert (np.diff(shown[times > 13.3]) > 0.85 / 60).all()


def test_age_counts_from_when_it_left_the_stage() -> None:
    poses = following(stage(range(200)))
    poses.take(12.0)
    moment = poses.moment(12.0)
    assert moment is not None
    assert 12.0 - poses.left_stage == pytest.approx(TICK_S, abs=1e-6)


def test_holds_grow_evenly_between_two_frames() -> None:
    poses = following(stage(range(20)))
    held = []
    for now in 10.2 + np.arange(0.0, 0.04, 0.001):
        poses.take(now)
        moment = poses.moment(now)
        assert moment is not None
        holds = np.asarray(moment.puppets[0].holds)
        assert holds[0] == 0.0
        held.append(float(holds[1]))
    assert min(held) < 0.1 and max(held) > 0.9
    assert np.abs(np.diff(held)).max() < 0.06
