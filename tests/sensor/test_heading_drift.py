"""Heading drift is estimated from the dance, and a body that turns is not taken for it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.sensor.heading_drift import MOST_RATE, SAMPLE_S, HeadingDrift
from appliance.sensor.heading_habit import HeadingHabit, habit_in
from appliance.sensor.neutral import NeutralPose, Stillness, to_stage

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
