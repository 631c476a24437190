"""However the sensor is worn and wherever its heading points, the joint turns as the dancer's limb does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.sensor.neutral import (
    STILL_S,
    Mounting,
    NeutralPose,
    Quaternion,
    Stillness,
    Vector,
    carried,
    facing_heading,
    front,
    joint_from_reading,
    to_stage,
    turned,
    with_heading_reset,
)

Rotation = NDArray[np.float64]
UP, FRONT = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
SENSOR_FROM_STAGE = [0, 3, 1, 2]  # written out here a second time: stage (x, y, z) = sensor (y, z, x)
PERIOD_S = 0.02

seeds = st.integers(0, 2**32 - 1)
headings = st.floats(-math.pi, math.pi)


def random_rotation(seed: int) -> Rotation:
    return quaternion.normalize(np.random.default_rng(seed).normal(size=4))


def about(axis: Vector, degrees: float) -> Rotation:
    return quaternion.from_axis_angle(axis, math.radians(degrees))


def turn(*rotations: Rotation) -> Rotation:
    """The product, the last one first."""
    product = rotations[0]
    for rotation in rotations[1:]:
        product = quaternion.multiply(product, rotation)
    return product


def heading(angle: float) -> Rotation:
    return quaternion.from_axis_angle(UP, angle)


def as_read(world_from_sensor: Rotation) -> Quaternion:
    """What a sensor says that has this orientation in its own world, stage axes; of either sign."""
    w, x, y, z = (float(part) for part in world_from_sensor[SENSOR_FROM_STAGE])
    return (w, x, y, z)


def sensor_axis(stage_axis: Rotation) -> Vector:
    x, y, z = (float(part) for part in stage_axis)
    return (z, x, y)


class Worn:
    """A limb with a sensor on it: the limb's orientation at the neutral pose, the mounting, the heading."""

    def __init__(self, standing: Rotation, mounting: Rotation, north: float, front_tilt: float = 0.0) -> None:
        self.standing, self.mounting, self.north = standing, mounting, north
        self.limb_from_sensor = turn(standing, mounting)
        tilted = quaternion.rotate(about((1.0, 0.0, 0.0), front_tilt), FRONT)
        self.facing = sensor_axis(quaternion.rotate(quaternion.inverse(self.limb_from_sensor), tilted))

    def reads(self, limb: Rotation, drift: float = 0.0) -> Quaternion:
        return as_read(turn(heading(self.north + drift), limb, self.mounting))


def the_same(orientation: NDArray[np.floating], expected: Rotation) -> bool:
    """Within what float32 leaves."""
    return float(quaternion.angle_between(np.asarray(orientation, float), expected)) < 1e-3


def test_an_ideal_sensor_reads_the_joint() -> None:
    matrix = joint_from_reading(NeutralPose((1.0, 0.0, 0.0, 0.0), 0.0, 1), Mounting())
    reading = (0.5, -0.1, 0.7, math.sqrt(1 - 0.25 - 0.01 - 0.49))
    assert matrix @ np.array(reading, np.float32) == pytest.approx(
        [0.5, 0.7, reading[3], -0.1], abs=1e-6
    )  # w, y, z, x
    assert to_stage(reading) == pytest.approx([0.5, 0.7, reading[3], -0.1])
    assert matrix.dtype == np.float32


def test_turning_to_the_left_turns_the_joint_to_the_left() -> None:
    matrix = joint_from_reading(NeutralPose((1.0, 0.0, 0.0, 0.0), 0.0, 1), Mounting())
    left = (math.cos(0.4), 0.0, 0.0, math.sin(0.4))  # about the sensor's z, which points up
    turned_left = quaternion.rotate(matrix @ np.array(left, np.float32), FRONT)
    assert turned_left == pytest.approx([math.sin(0.8), 0.0, math.cos(0.8)], abs=1e-6)  # x is on the left


@given(seeds, seeds, seeds, headings, st.floats(-70.0, 70.0))
def test_the_joint_turns_as_the_limb_does(
    standing: int, mounting: int, limb: int, north: float, front_tilt: float
) -> None:
    worn = Worn(random_rotation(standing), random_rotation(mounting), north, front_tilt)
    neutral = NeutralPose(worn.reads(worn.standing), 0.0, 1)
    matrix = joint_from_reading(neutral, Mounting(facing=worn.facing, at_neutral=tuple(worn.standing)))
    dances = random_rotation(limb)
    target = matrix @ np.array(worn.reads(dances), np.float32)
    assert the_same(target, dances)
    assert np.linalg.norm(target) == pytest.approx(1.0, abs=1e-5)


@given(seeds, seeds, seeds, seeds, headings, headings)
def test_a_heading_reset_takes_out_drift_and_leaves_tilt(
    standing: int, mounting: int, tilt: int, limb: int, north: float, drift: float
) -> None:
    worn = Worn(random_rotation(standing), random_rotation(mounting), north)
    neutral = NeutralPose(worn.reads(worn.standing), 0.0, 1)
    # At the reset the dancer faces the front, and the limb hangs a little otherwise than it did.
    x, z = np.random.default_rng(tilt).normal(size=2)
    leaning = turn(quaternion.from_axis_angle([x, 0.0, z], 1.2), worn.standing)
    reset = with_heading_reset(neutral, worn.reads(leaning, drift))
    assert reset is not None
    assert math.remainder(reset.heading - drift, math.tau) == pytest.approx(0.0, abs=1e-6)
    matrix = joint_from_reading(reset, Mounting(facing=worn.facing, at_neutral=tuple(worn.standing)))
    dances = random_rotation(limb)
    assert the_same(matrix @ np.array(worn.reads(dances, drift), np.float32), dances)
    assert (reset.orientation, reset.boot_nonce) == (neutral.orientation, neutral.boot_nonce)


@given(seeds, seeds, headings, headings)
def test_a_sensor_that_lost_its_heading_goes_on_where_it_was(
    mounting: int, limb: int, north: float, lost: float
) -> None:
    worn = Worn(quaternion.IDENTITY.astype(float), random_rotation(mounting), north)
    neutral = NeutralPose(worn.reads(worn.standing), 0.0, 1)
    dances = random_rotation(limb)
    pose = carried(neutral, worn.reads(dances), worn.reads(dances, lost), boot_nonce=2)
    assert pose.boot_nonce == 2
    matrix = joint_from_reading(pose, Mounting(facing=worn.facing))
    assert the_same(matrix @ np.array(worn.reads(dances, lost), np.float32), dances)


@given(seeds, headings, headings)
def test_what_is_carried_keeps_the_new_tilt(mounting: int, north: float, lost: float) -> None:
    worn = Worn(quaternion.IDENTITY.astype(float), random_rotation(mounting), north)
    neutral = NeutralPose(worn.reads(worn.standing), 0.0, 1)
    tilted = about((1.0, 0.0, 0.0), 50.0)
    pose = carried(neutral, worn.reads(worn.standing), worn.reads(tilted, lost), boot_nonce=2)
    matrix = joint_from_reading(pose, Mounting(facing=worn.facing))
    assert the_same(matrix @ np.array(worn.reads(tilted, lost), np.float32), tilted)


def test_headings_are_carried_over_one_restart_after_another() -> None:
    worn = Worn(quaternion.IDENTITY.astype(float), random_rotation(1), north=0.3)
    pose = NeutralPose(worn.reads(worn.standing), 0.0, 1)
    dances, drift = random_rotation(2), 0.0
    for boot, lost in ((2, 2.5), (3, 2.5), (4, -1.0)):
        before = worn.reads(dances, drift)
        drift += lost
        pose = carried(pose, before, worn.reads(dances, drift), boot)
    assert abs(pose.heading) <= math.pi
    matrix = joint_from_reading(pose, Mounting(facing=worn.facing))
    assert the_same(matrix @ np.array(worn.reads(dances, drift), np.float32), dances)


@given(seeds, headings)
def test_an_axis_that_stands_upright_has_no_heading(seed: int, north: float) -> None:
    worn = Worn(quaternion.IDENTITY.astype(float), random_rotation(seed), north)
    upright = sensor_axis(quaternion.rotate(quaternion.inverse(worn.mounting), UP))
    reading = worn.reads(worn.standing)
    assert facing_heading(reading, upright) is None
    angle, axis = front(reading, upright)
    assert axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert facing_heading(reading, axis) == angle


def test_an_arrow_that_points_down_leaves_the_front_to_the_lid() -> None:
    arm_hangs = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)  # about y: the arrow down, the lid to the front
    angle, axis = front(arm_hangs, (1.0, 0.0, 0.0))
    assert axis == (0.0, 0.0, 1.0)
    assert angle == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("degrees", [10.0, 14.9, 15.1, 40.0])
def test_fifteen_degrees_from_the_vertical_are_needed(degrees: float) -> None:
    leaning = as_read(about((1.0, 0.0, 0.0), -(90.0 - degrees)))  # the front axis rises by 90 - degrees
    assert (facing_heading(leaning, (1.0, 0.0, 0.0)) is None) == (degrees < 15.0)


@given(headings, seeds)
def test_the_heading_between_two_readings_is_what_turns_one_to_the_other(angle: float, seed: int) -> None:
    assume(abs(angle) < 3.1)
    orientation = random_rotation(seed)
    between = turned(as_read(orientation), as_read(-turn(heading(angle), orientation)))
    assert between == pytest.approx(angle, abs=1e-6)


def test_upside_down_no_heading_can_be_told() -> None:
    upright, flipped = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
    assert turned(upright, flipped) is None
    neutral = NeutralPose(upright, 0.4, 1)
    assert with_heading_reset(neutral, flipped) is None
    assert carried(neutral, upright, flipped, 2).heading == pytest.approx(0.4)


def stand(
    stillness: Stillness, seconds: float, start: float, degrees: float = 0.0, sway: float = 0.0
) -> float:
    """Hear a standing dancer at 50 Hz who sways this far to both sides; when it ended."""
    for step in range(round(seconds / PERIOD_S)):
        angle = degrees + sway * math.sin(0.5 * step)
        stillness.add_reading(as_read(about((1.0, 0.0, 0.0), angle)), start + step * PERIOD_S)
    return start + seconds


def test_standing_still_counts_from_the_first_reading_on() -> None:
    stillness = Stillness()
    assert stillness.still_s == 0.0
    stand(stillness, STILL_S + PERIOD_S, 100.0, sway=1.4)
    assert stillness.still_s == pytest.approx(STILL_S)


def test_a_move_of_more_than_three_degrees_begins_anew() -> None:
    stillness = Stillness()
    at = stand(stillness, 1.0, 100.0)
    stand(stillness, 0.5, at, degrees=2.8)
    assert stillness.still_s == pytest.approx(1.48)
    stand(stillness, 0.5, at + 0.5, degrees=3.2)
    assert stillness.still_s == pytest.approx(0.48)


def test_a_slow_turn_is_not_standing_still() -> None:
    stillness, longest = Stillness(), 0.0
    for step in range(500):
        stillness.add_reading(as_read(about((0.0, 1.0, 0.0), 5.0 * step * PERIOD_S)), step * PERIOD_S)
        longest = max(longest, stillness.still_s)
    assert 0.3 < longest < 0.7


def test_a_sign_that_flips_is_no_movement() -> None:
    stillness = Stillness()
    for step in range(100):
        stillness.add_reading((0.6 * (-1.0) ** step, 0.8 * (-1.0) ** step, 0.0, 0.0), step * PERIOD_S)
    assert stillness.still_s == pytest.approx(99 * PERIOD_S)


def test_a_silence_begins_anew() -> None:
    stillness = Stillness()
    at = stand(stillness, 1.0, 100.0)
    stand(stillness, 1.0, at + 0.5)
    assert stillness.still_s == pytest.approx(0.98)


def test_restarted_it_counts_from_the_next_reading() -> None:
    stillness = Stillness()
    at = stand(stillness, 2.0, 100.0)
    stillness.restart()
    assert stillness.still_s == 0.0
    stand(stillness, 1.0, at)
    assert stillness.still_s == pytest.approx(0.98)
