"""However the sensor is worn and wherever its heading points, the joint turns as the dancer's limb does."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from appliance.box.snapshot import packed, restore
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.sensor.heading_drift import MOST_RATE, SAMPLE_S, HeadingDrift
from appliance.sensor.heading_habit import HeadingHabit, habit_in
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


ARM = Skeleton(("root", "arm"), (-1, 0), np.array([[0.0, 0.0, 0.0], [0.2, 1.4, 0.0]]))
MINUTE_S = 60.0
HELD = NeutralPose((1.0, 0.0, 0.0, 0.0), 0.0, 1)
BEGINS_S = 1000.0

Degrees = Callable[[float], float]


def arm_at(at_s: np.ndarray) -> np.ndarray:
    """An arm that dances in front of its body: (N, 4), stage axes. It never stands still nor repeats."""
    azimuth = 25.0 * np.sin(2 * np.pi * at_s / 3.1) + 20.0 * np.sin(2 * np.pi * at_s / 7.7)
    raised = 40.0 + 30.0 * np.sin(2 * np.pi * at_s / 4.3)
    up, side = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    turned = quaternion.from_axis_angle(up, np.radians(azimuth))
    return quaternion.multiply(turned, quaternion.from_axis_angle(side, np.radians(raised)))


def habit() -> HeadingHabit:
    """As the phrase of a show tells it, whose body turns meanwhile."""
    at_s = np.arange(0.0, 90.0, 0.02)
    facing = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), at_s / 5.0)
    return habit_in([(np.stack([facing, arm_at(at_s)], axis=1), 50.0)], ARM, 1, (1.0, 0.0, 0.0, 0.0))


@dataclass
class Dancer:
    """Wears a sensor whose heading drifts, and faces where `facing` says; both in degrees by seconds."""

    drift: HeadingDrift
    drifts: Degrees
    facing: Degrees = lambda _: 0.0
    pose: NeutralPose = HELD
    now: float = BEGINS_S
    still: Stillness = field(default_factory=Stillness)
    steps: list[float] = field(default_factory=list)

    def dance(self, seconds: float) -> None:
        self._go_on(seconds, lambda at_s: arm_at(np.array(at_s)))

    def stand(self, seconds: float) -> None:
        self._go_on(seconds, lambda _: np.array([1.0, 0.0, 0.0, 0.0]))

    @property
    def off(self) -> float:
        """Degrees by which its joint's heading is wrong."""
        return self.drifts(self.now - BEGINS_S) - math.degrees(self.pose.heading)

    def _go_on(self, seconds: float, arm: Callable[[float], np.ndarray]) -> None:
        for _ in range(round(seconds / SAMPLE_S)):
            self.now += SAMPLE_S
            at_s = self.now - BEGINS_S
            read = quaternion.multiply(_about_up(self.drifts(at_s) + self.facing(at_s)), arm(at_s))
            w, y, z, x = map(float, read)  # sensor axes: z up
            joint = quaternion.multiply(_about_up(-math.degrees(self.pose.heading)), to_stage((w, x, y, z)))
            self.still.add_reading((w, x, y, z), self.now)
            step = self.drift.look((w, x, y, z), joint.tolist(), self.pose, self.still.still_s, self.now)
            self.pose = replace(self.pose, heading=self.pose.heading + math.radians(step))
            self.steps.append(step)


def _about_up(degrees: float) -> np.ndarray:
    half = math.radians(degrees) / 2
    return np.array([math.cos(half), 0.0, math.sin(half), 0.0])


@pytest.mark.parametrize("a_minute", [0.5, -1.0, 3.0])
def test_drift_is_taken_out_while_the_dancer_dances(a_minute: float) -> None:
    dancer = Dancer(HeadingDrift(habit()), lambda at_s: a_minute * at_s / MINUTE_S)
    dancer.dance(40 * MINUTE_S)
    assert abs(dancer.off) < abs(40 * a_minute) / 4
    assert dancer.drift.rate == pytest.approx(a_minute, abs=0.25)
    assert dancer.drift.corrected == pytest.approx(math.degrees(dancer.pose.heading))


def test_a_correction_moves_no_faster_than_its_bound() -> None:
    dancer = Dancer(HeadingDrift(habit()), lambda at_s: 25.0 if at_s > MINUTE_S else 0.0)
    dancer.dance(30 * MINUTE_S)
    in_a_minute = np.convolve(np.abs(dancer.steps), np.ones(round(MINUTE_S / SAMPLE_S)), "valid")
    assert in_a_minute.max() <= MOST_RATE * MINUTE_S * 1.02 and in_a_minute.max() > 1.0


@pytest.mark.parametrize(
    "facing",
    [
        lambda at_s: 90.0 if 600.0 < at_s < 720.0 else 0.0,
        lambda at_s: -90.0 if at_s % 120.0 < 60.0 else 0.0,
        lambda at_s: 6.0 * at_s,
        lambda at_s: 90.0 * math.sin(at_s / 8.0),
    ],
    ids=["a quarter turn for two minutes", "now here now there", "a slow spin", "walks in circles"],
)
def test_a_body_that_turns_is_no_drift(facing: Degrees) -> None:
    dancer = Dancer(HeadingDrift(habit()), lambda _: 0.0, facing)
    for _ in range(30):
        dancer.dance(MINUTE_S)
        assert abs(dancer.off) < 5.0


@pytest.mark.parametrize("aside", [30.0, -45.0])
def test_a_body_turned_aside_for_two_minutes_is_followed_by_less_than_half_and_taken_back(
    aside: float,
) -> None:
    dancer = Dancer(HeadingDrift(habit()), lambda _: 0.0, lambda at_s: aside if 600.0 < at_s < 720.0 else 0.0)
    farthest = 0.0
    for _ in range(30):
        dancer.dance(MINUTE_S)
        farthest = max(farthest, abs(dancer.off))
    assert abs(dancer.off) < 4.0
    assert farthest < abs(aside) / 2


def test_without_a_habit_a_dance_says_nothing() -> None:
    dancer = Dancer(HeadingDrift(), lambda at_s: at_s / MINUTE_S)
    dancer.dance(20 * MINUTE_S)
    assert dancer.drift.corrected == 0.0


def test_a_sensor_that_lies_shows_its_drift_before_anybody_wears_it() -> None:
    drift = HeadingDrift()
    for sample in range(round(2 * MINUTE_S / SAMPLE_S)):
        at_s = sample * SAMPLE_S
        half = math.radians(2.0 * at_s / MINUTE_S) / 2
        drift.look(
            (math.cos(half), 0.0, 0.0, math.sin(half)), (1.0, 0.0, 0.0, 0.0), None, 0.0, BEGINS_S + at_s
        )
    assert drift.rate == pytest.approx(2.0, abs=0.2)
    drift.take_neutral()
    assert drift.rate == pytest.approx(2.0, abs=0.2) and drift.corrected == 0.0
    drift.restart()
    assert drift.rate == 0.0


def test_a_dancer_that_stands_as_in_the_neutral_pose_shows_where_the_front_is() -> None:
    dancer = Dancer(HeadingDrift(), lambda at_s: at_s / MINUTE_S)
    for _ in range(20):
        dancer.dance(1.8 * MINUTE_S)
        dancer.stand(5.0)
    assert abs(dancer.off) < 10.0 < dancer.drift.corrected


def test_it_continues_from_a_snapshot_to_the_last_bit() -> None:
    through = Dancer(HeadingDrift(habit()), lambda at_s: at_s / 40.0)
    through.dance(10.3 * MINUTE_S)
    other = replace(
        through, drift=HeadingDrift(habit()), still=Stillness(), steps=[], pose=through.pose, now=through.now
    )
    restore(other.drift, packed(through.drift))
    restore(other.still, packed(through.still))
    begun = len(through.steps)
    for dancer in (through, other):
        dancer.dance(5 * MINUTE_S)
    assert any(other.steps) and through.steps[begun:] == other.steps
    assert packed(through.drift) == packed(other.drift)
