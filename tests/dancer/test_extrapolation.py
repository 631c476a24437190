"""How a hand's motion is carried on over the window: as far as it is steady, and no jump or noise grows."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.box.snapshot import packed, restore
from appliance.dancer.blending import Blending
from appliance.dancer.extrapolation import MOST_RADIANS, Extrapolation
from appliance.pose import quaternion
from tests.dancer.conftest import random_quaternions

WINDOW = 8
TICK_S = 0.02


def ahead(course: np.ndarray, is_new: Callable[[int], bool] = lambda tick: tick == 0) -> np.ndarray:
    """Targets (ticks, window, 4) of a joint that takes this course (ticks, 4)."""
    extrapolation = Extrapolation(1, WINDOW)
    made = np.empty((len(course), WINDOW, 1, 4), dtype=np.float32)
    for tick, orientation in enumerate(quaternion.continuous(course).astype(np.float32)):
        extrapolation(orientation[None], np.array([[is_new(tick)]]), made[tick])
    return made[:, :, 0]


def turning(degrees_per_s: float, ticks: int = 60, axis: tuple[float, ...] = (0.3, 1.0, -0.2)) -> np.ndarray:
    return quaternion.from_axis_angle(axis, np.radians(degrees_per_s) * TICK_S * np.arange(ticks))


def degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(quaternion.angle_between(a, b))


def blended(targets: np.ndarray) -> np.ndarray:
    """What of these targets comes out where every pass is interactive: the poses (ticks, 4) of the joint."""
    blending, poses = Blending(1, WINDOW), []
    for window in targets:
        blending.add(np.ascontiguousarray(window[:, None]))
        poses.append(blending.take()[0].copy())
    return np.array(poses)


def test_the_first_pose_is_the_present_and_all_are_unit() -> None:
    course = quaternion.continuous(random_quaternions(np.random.default_rng(0), 200))
    targets = ahead(course)
    assert degrees(targets[:, 0], course).max() < 0.01
    assert np.linalg.norm(targets, axis=-1) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("seconds_per_turn", "off_degrees"), [(1.0, 11.5), (5.0, 2.3)])
def test_a_steady_turn_is_carried_on(seconds_per_turn: float, off_degrees: float) -> None:
    """Four ticks ahead, where the window counts most: one orientation for all is 29 and 5.8 degrees off."""
    course = turning(360 / seconds_per_turn, 100)
    targets = ahead(course)
    assert degrees(targets[10:90, 4], course[14:94]).max() < off_degrees
    still = np.repeat(targets[:, :1], WINDOW, axis=1)
    one, other = (degrees(blended(made)[20:90], course[20:90]).mean() for made in (targets, still))
    assert one < 0.4 * other


@given(st.floats(0.1, 180.0), st.integers(0, 2**32 - 1))
def test_a_jump_is_not_carried_on(jump_degrees: float, seed: int) -> None:
    before, axis = random_quaternions(np.random.default_rng(seed), 2)
    jump = quaternion.from_axis_angle(axis[1:], math.radians(jump_degrees)).astype(np.float32)
    after = quaternion.multiply(jump, before)
    targets = ahead(np.array([before] * 10 + [after] * 10))
    assert np.minimum(degrees(targets, before), degrees(targets, after)).max() < 0.1


def test_a_jump_of_a_hand_that_turns_is_carried_on_by_its_turning_alone() -> None:
    course = turning(72.0, 60)
    jump = quaternion.from_axis_angle([1.0, 0.0, 0.0], math.radians(90))
    course[30:] = quaternion.multiply(np.broadcast_to(jump, (30, 4)), course[30:])
    targets = ahead(course)
    assert degrees(targets, targets[:, :1]).max() < 2 * 4.5


@pytest.mark.parametrize(
    ("degrees_per_s", "stops_in", "most_degrees"), [(72, 0, 2), (180, 3, 4), (360, 5, 6)]
)
def test_a_stop_overshoots_little(degrees_per_s: float, stops_in: int, most_degrees: float) -> None:
    speeds = np.concatenate([np.full(60, 1.0), np.linspace(1, 0, stops_in + 1)[1:], np.zeros(40)])
    angles = np.radians(degrees_per_s) * TICK_S * np.cumsum(speeds)
    shown = blended(ahead(quaternion.from_axis_angle([0.0, 0.0, 1.0], angles)))
    course = np.degrees(2 * np.unwrap(np.arctan2(shown[:, 3], shown[:, 0])))
    assert 0 <= course.max() - course[-1] < most_degrees


@pytest.mark.parametrize(("degrees_per_s", "most_degrees"), [(0.0, 0.15), (72.0, 0.33), (360.0, 0.33)])
def test_a_sensors_noise_is_hardly_amplified(degrees_per_s: float, most_degrees: float) -> None:
    rng, course = np.random.default_rng(1), turning(degrees_per_s, 4000)
    angles = np.radians(0.1) * rng.normal(size=(4000, 3)) / math.sqrt(3)
    noise = quaternion.normalize(np.concatenate([np.ones((4000, 1)), angles / 2], axis=1))
    noisy, clean = ahead(quaternion.multiply(noise, course)), ahead(course)
    assert np.sqrt((degrees(noisy[20:, -1], clean[20:, -1]) ** 2).mean()) < most_degrees


def test_whatever_comes_no_pose_is_carried_further_than_the_bound() -> None:
    course = random_quaternions(np.random.default_rng(2), 3000)
    fast = turning(9000.0, 300)
    for targets in (ahead(course), ahead(fast)):
        assert quaternion.angle_between(targets, targets[:, :1]).max() < 1.001 * MOST_RADIANS
        assert np.sum(targets[:, 1:] * targets[:, :-1], axis=-1).min() > 0.9


def test_nothing_that_was_before_a_joint_is_new_counts() -> None:
    course = turning(360.0, 40)
    targets = ahead(course, lambda tick: tick <= 20)
    assert degrees(targets[:21], targets[:21, :1]).max() < 1e-3
    assert degrees(targets[21], targets[21, :1]).max() < 1e-3
    assert targets[26:] == pytest.approx(ahead(course)[26:], abs=1e-6)


def test_one_that_was_restored_goes_on_bit_for_bit() -> None:
    course = turning(200.0, 60).astype(np.float32)
    one, other = Extrapolation(1, WINDOW), Extrapolation(1, WINDOW)
    known = np.array([[False]])
    for tick in range(60):
        if tick == 31:
            restore(other, packed(one))
        made = np.empty((2, WINDOW, 1, 4), dtype=np.float32)
        one(course[tick][None], known, made[0])
        other(course[tick if tick > 30 else 0][None], known, made[1])
        if tick > 30:
            assert np.array_equal(made[0], made[1])
