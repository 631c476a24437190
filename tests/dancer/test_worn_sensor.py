"""A worn sensor: how it takes its joint, shows its readings, and lets go."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.dancer.puppeteers import LONGEST_STEP_S, WornSensor
from appliance.pose import quaternion
from tests.dancer.conftest import random_quaternions
from tests.dancer.pulled import LEFT, RIGHT, TICK_S, weights, worn


def test_a_sensor_that_was_never_heard_holds_nothing() -> None:
    assert weights(WornSensor("lShldr"), 0.0, 3.0).max() == 0.0


def test_a_sensor_takes_its_joint_over_half_a_second() -> None:
    sensor = WornSensor("lShldr")
    sensor.pull(0.0)
    course = []
    for tick in range(1, 40):
        sensor.take_reading(LEFT, tick * TICK_S)
        course.append(sensor.pull(tick * TICK_S).weight)
    assert course[12] == pytest.approx(0.5, abs=0.06)
    assert course[24] == pytest.approx(1.0)
    assert np.all(np.diff(course) >= 0)
    assert np.diff(course).max() < 0.07


def test_a_silent_sensor_holds_for_100_ms_then_gives_its_joint_back_over_one_second() -> None:
    sensor = worn(1.0)
    course = weights(sensor, 1.02, 3.0)
    assert (course[:4] == 1.0).all()  # 1.10 s is on the edge of the 100 ms
    assert course[4 + 25] == pytest.approx(0.5, abs=0.04)
    assert course[4 + 46] > 0.0
    assert (course[4 + 51 :] == 0.0).all()
    assert np.all(np.diff(course) <= 0)
    assert np.abs(np.diff(course)).max() < 0.04
    assert quaternion.angle_between(sensor.pull(3.0).orientation, np.array(LEFT)) < 1e-3


def test_a_short_silence_of_a_lifelike_network_is_hardly_seen() -> None:
    sensor = worn(1.0)
    assert weights(sensor, 1.02, 1.1).min() == 1.0
    assert weights(sensor, 1.1, 1.24).min() > 0.9


def test_after_a_silence_the_joint_is_taken_again_and_led_to_the_new_readings() -> None:
    sensor = worn(1.0)
    weights(sensor, 1.02, 1.6)
    before = sensor.pull(1.6)
    weight, orientation = before.weight, before.orientation.copy()
    assert 0.2 < weight < 0.8
    turns = []
    for tick in range(81, 81 + 30):
        sensor.take_reading(RIGHT, tick * TICK_S)
        target = sensor.pull(tick * TICK_S)
        turns.append(float(quaternion.angle_between(target.orientation, orientation)))
        assert target.weight >= weight
        weight, orientation = target.weight, target.orientation.copy()
    assert weight == pytest.approx(1.0)
    assert max(turns) < 2 * 1.2 / 25  # 1.2 rad, spread evenly over half a second
    assert quaternion.angle_between(orientation, np.array(RIGHT)) < 1e-3


@pytest.mark.parametrize("stop_s", [0.2, 0.7, 5.0])
def test_a_stage_that_stood_still_goes_on_from_where_it_was(stop_s: float) -> None:
    """Readings that wait meanwhile may be heard a tick later: no hand is let go in one step, or jumps."""
    sensor = worn(1.0)
    shown = [(1.0, np.array(LEFT, np.float32))]
    for tick in range(60):
        now = 1.0 + stop_s + tick * TICK_S
        if tick:
            sensor.take_reading(RIGHT, now)
        target = sensor.pull(now)
        shown.append((target.weight, target.orientation.copy()))
    weights = np.array([weight for weight, _ in shown])
    turns = np.array([turn for _, turn in shown])
    assert weights.min() > 0.9
    assert weights[-1] == 1.0
    apart = 1.2 if stop_s > 0.5 else 1.2 * 0.5 / stop_s
    assert quaternion.angle_between(turns[1:], turns[:-1]).max() < 1.1 * apart * TICK_S / 0.5
    assert quaternion.angle_between(turns[-1], np.array(RIGHT)) < 1e-3


def test_readings_that_are_heard_right_after_a_stop_are_led_to_as_well() -> None:
    sensor = worn(1.0)
    sensor.take_reading(RIGHT, 1.7)
    turned = quaternion.angle_between(sensor.pull(1.7).orientation, np.array(LEFT))
    assert turned == pytest.approx(1.2 * LONGEST_STEP_S / 0.5, rel=0.01)


def test_while_it_is_heard_the_target_is_the_newest_reading_at_once() -> None:
    sensor = worn(1.0)
    sensor.take_reading(RIGHT, 1.02)
    assert quaternion.angle_between(sensor.pull(1.02).orientation, np.array(RIGHT)) < 1e-3


def random_matrix(seed: int) -> np.ndarray:
    """What turns a reading by two rotations and swaps its axes round, as a worn sensor's does."""
    left, right = random_quaternions(np.random.default_rng(seed), 2)
    axes = np.eye(4, dtype=np.float32)[:, [0, 2, 3, 1]]
    return quaternion.multiply(quaternion.multiply(left, axes), right).T.astype(np.float32)


@given(st.integers(0, 2**32 - 1))
def test_a_reading_goes_through_the_matrix_of_how_it_is_worn(seed: int) -> None:
    matrix, reading = random_matrix(seed), random_quaternions(np.random.default_rng(seed + 1))
    sensor = WornSensor("lShldr", joint_from_reading=matrix)
    sensor.take_reading(reading.tolist(), 0.0)
    assert sensor.pull(0.0).orientation == pytest.approx(matrix @ reading, abs=1e-6)


def test_worn_anew_before_it_is_heard_it_counts_at_once() -> None:
    sensor, matrix = WornSensor("lShldr"), random_matrix(1)
    sensor.wear(matrix)
    sensor.take_reading(LEFT, 0.0)
    sensor.pull(0.0)
    sensor.take_reading(LEFT, 0.02)
    assert sensor.pull(0.02).orientation == pytest.approx(matrix @ np.array(LEFT, np.float32), abs=1e-6)


@pytest.mark.parametrize("silence_s", [0.0, 0.14])
def test_worn_anew_while_it_dances_the_joint_is_led_over(silence_s: float) -> None:
    sensor, matrix = worn(1.0), random_matrix(3)
    before = sensor.pull(1.0).orientation.copy()
    after = matrix @ np.array(LEFT, np.float32)
    apart = float(quaternion.angle_between(before, after))
    assert apart > 1.0
    sensor.wear(matrix)
    assert (sensor.pull(1.0).orientation == before).all()
    shown = [before]
    for tick in range(51, 90):
        if tick > 50 + silence_s / TICK_S:
            sensor.take_reading(LEFT, tick * TICK_S)
        shown.append(sensor.pull(tick * TICK_S).orientation.copy())
    steps = quaternion.angle_between(np.array(shown[1:]), np.array(shown[:-1]))
    assert steps.max() < 1.3 * apart / 25  # evenly over half a second
    assert shown[-1] == pytest.approx(after, abs=1e-5)


def test_time_that_does_not_go_on_changes_nothing() -> None:
    sensor = worn(1.0)
    for now in (1.0, 0.5, 1.0):
        assert sensor.pull(now).weight == 1.0


def test_a_hand_that_is_disabled_lets_go_over_one_second_and_takes_again_over_half_of_one() -> None:
    sensor = worn(1.0)
    sensor.enabled = False
    course = []
    for tick in range(51, 120):
        sensor.take_reading(RIGHT, tick * TICK_S)  # the dancer goes on moving
        course.append(sensor.pull(tick * TICK_S).weight)
    assert course[24] == pytest.approx(0.5, abs=0.04)
    assert course[48] > 0.0 and course[50] == 0.0
    assert np.diff(course).min() > -0.04
    sensor.enabled = True
    course = []
    for tick in range(120, 150):
        sensor.take_reading(RIGHT, tick * TICK_S)
        course.append(sensor.pull(tick * TICK_S).weight)
    assert course[12] == pytest.approx(0.5, abs=0.06)
    assert course[26] == pytest.approx(1.0)
    assert quaternion.angle_between(sensor.pull(3.0).orientation, np.array(RIGHT)) < 1e-3


def hand_at(seconds: float) -> np.ndarray:
    """A hand that swings by 60 degrees to each side, once a second."""
    return quaternion.from_axis_angle(np.array([0.6, 0.8, 0.0]), np.radians(60) * np.sin(2 * np.pi * seconds))


@pytest.mark.parametrize(("every_s", "age_s"), [(0.02, 0.004), (0.02, 0.009), (0.01, 0.008)])
def test_a_reading_is_turned_on_to_the_time_of_the_tick(every_s: float, age_s: float) -> None:
    """Against a sensor whose readings have no time: the hand that is held is the older one."""
    reported, untold = WornSensor("lShldr"), WornSensor("lShldr")
    apart: list[list[float]] = []
    for tick in range(1, 200):
        now = tick * TICK_S
        for part in range(round(TICK_S / every_s), 0, -1):
            measured_at = now - age_s - (part - 1) * every_s
            reported.take_reading(hand_at(measured_at), now, measured_at)
            untold.take_reading(hand_at(measured_at), now)
        held = [sensor.pull(now).orientation.copy() for sensor in (reported, untold)]
        apart.append([float(quaternion.angle_between(one, hand_at(now))) for one in held])
    turned_on, as_it_came = np.median(np.degrees(apart[50:]), axis=0)
    assert turned_on < 0.3 * as_it_came


def test_a_hand_that_stops_is_not_thrown_further() -> None:
    sensor = WornSensor("lShldr")
    for tick in range(1, 60):
        angle = min(tick, 50) * 0.1
        orientation = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
        sensor.take_reading(orientation, tick * TICK_S, tick * TICK_S)
        held = sensor.pull(tick * TICK_S + 0.019).orientation
        most = 0.5 * 0.1 + 1e-3 if tick <= 50 else 1e-3  # AHEAD_S is half of a tick
        assert quaternion.angle_between(held, orientation) < most
