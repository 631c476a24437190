"""Hands that no sensor moves: a turning axis, a fixed orientation, and joints held by OSC."""

from __future__ import annotations

import math

import numpy as np
import pytest

from appliance.dancer.puppeteers import LONGEST_STEP_S, FixedOrientation, Remote, TurningAxis
from appliance.pose import quaternion
from tests.dancer.pulled import LEFT, RIGHT, TICK_S, weights


@pytest.mark.parametrize("seconds", [1.0, 5.0, -2.0])
def test_a_turning_axis_turns_at_a_constant_rate(seconds: float) -> None:
    turning = TurningAxis("head", (0.0, 2.0, 0.0), seconds)
    course = np.array([turning.pull(100.0 + tick * TICK_S).orientation.copy() for tick in range(1000)])
    steps = quaternion.angle_between(course[1:], course[:-1])
    assert steps == pytest.approx(math.tau / abs(seconds) * TICK_S, rel=1e-2)
    after_one_turn = round(abs(seconds) / TICK_S)
    assert quaternion.angle_between(course[after_one_turn], course[0]) < 1e-2
    axis, _ = quaternion.to_axis_angle(course[3])
    assert axis == pytest.approx([0.0, math.copysign(1.0, seconds), 0.0], abs=1e-5)


def test_a_turning_axis_does_not_jump_over_a_stop() -> None:
    turning = TurningAxis("head", (0.0, 1.0, 0.0), 4.0)
    before = turning.pull(1.0).orientation.copy()
    after = turning.pull(2.0).orientation
    assert quaternion.angle_between(after, before) <= math.tau / 4.0 * LONGEST_STEP_S + 1e-3


@pytest.mark.parametrize(("axis", "seconds"), [((0, 0, 0), 1.0), ((0, 1), 1.0), ((0, 1, 0), 0.0)])
def test_an_axis_that_cannot_turn_is_refused(axis: tuple[float, ...], seconds: float) -> None:
    with pytest.raises(ValueError, match=r"direction|0 seconds"):
        TurningAxis("head", axis, seconds)


def test_a_fixed_orientation_is_taken_smoothly_and_kept() -> None:
    fixed = FixedOrientation("head", [2.0, 0.0, 0.0, 2.0], weight=0.6)
    course = [fixed.pull(tick * TICK_S).weight for tick in range(60)]
    assert course[0] == 0.0
    assert course[-1] == pytest.approx(0.6)
    assert np.diff(course).max() < 0.05
    assert fixed.pull(2.0).orientation == pytest.approx([math.sqrt(0.5), 0, 0, math.sqrt(0.5)])


def test_a_new_weight_is_reached_gradually() -> None:
    fixed = FixedOrientation("head", LEFT, weight=1.0)
    weights(fixed, 0.0, 1.0)
    fixed.weight = 0.2
    course = weights(fixed, 1.0, 2.0)
    assert np.abs(np.diff(course)).max() < 0.05
    assert course[-1] == pytest.approx(0.2)


def test_a_remote_hand_takes_and_releases() -> None:
    remote = Remote("head")
    assert weights(remote, 0.0, 0.5).max() == 0.0
    remote.hold_axis_angle((0.0, 0.0, 3.0), math.pi / 2)
    assert weights(remote, 0.5, 1.2)[-1] == pytest.approx(1.0)
    expected = quaternion.from_axis_angle([0, 0, 1], math.pi / 2)
    assert quaternion.angle_between(remote.pull(1.2).orientation, expected) < 1e-3
    remote.hold(RIGHT)
    assert quaternion.angle_between(remote.pull(1.22).orientation, np.array(RIGHT)) < 1e-3
    remote.release()
    course = weights(remote, 1.24, 2.4)
    assert course[24] == pytest.approx(0.5, abs=0.05)
    assert course[-1] == 0.0
    assert np.abs(np.diff(course)).max() < 0.04
    assert not remote.is_holding


def test_a_hand_by_osc_holds_where_its_joint_is_unless_it_was_told_before() -> None:
    remote = Remote("lShldr")
    remote.hold_here(LEFT)
    assert weights(remote, 0.0, 1.0)[-1] == pytest.approx(1.0)
    assert quaternion.angle_between(remote.pull(1.0).orientation, np.array(LEFT)) < 1e-3
    remote.hold(RIGHT)
    remote.hold_here(LEFT)
    assert quaternion.angle_between(remote.pull(1.02).orientation, np.array(RIGHT)) < 1e-3
    remote.release()
    assert weights(remote, 1.04, 3.0)[-1] == 0.0


@pytest.mark.parametrize("orientation", [[0, 0, 0, 0], [1, 0, 0], [math.nan, 0, 0, 1], [math.inf, 0, 0, 0]])
def test_what_is_no_orientation_is_refused(orientation: list[float]) -> None:
    remote = Remote("head")
    with pytest.raises(ValueError, match="no orientation"):
        remote.hold(orientation)
    assert weights(remote, 0.0, 1.0).max() == 0.0


@pytest.mark.parametrize(("axis", "angle"), [((0, 0, 0), 1.0), ((0, 1), 1.0), ((0, 1, 0), math.inf)])
def test_what_is_no_rotation_is_refused(axis: tuple[float, ...], angle: float) -> None:
    with pytest.raises(ValueError, match="no rotation"):
        Remote("head").hold_axis_angle(axis, angle)
