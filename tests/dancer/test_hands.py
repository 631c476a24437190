"""Hands: what the puppet gets of the joints that they hold, and how smoothly it comes."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.dancer.hands import HandError, Hands
from appliance.dancer.puppeteers import (
    LONGEST_STEP_S,
    TAKE_S,
    FixedOrientation,
    Kept,
    Puppeteer,
    Remote,
    TurningAxis,
    WornSensor,
)
from appliance.pose import quaternion
from appliance.pose.ease import ease
from tests.dancer.conftest import random_quaternions
from tests.dancer.pulled import LEFT, RIGHT, TICK_S, weights, worn

JOINTS = ("hip", "lShldr", "rShldr", "head")
WINDOW = np.tile(quaternion.IDENTITY, (8, len(JOINTS), 1))


def test_hands_gather_mask_targets_and_weights() -> None:
    sensor = worn(1.0)
    hands = Hands([FixedOrientation("head", RIGHT, weight=0.5), sensor, Remote("rShldr")], JOINTS)
    for tick in range(51, 100):
        sensor.take_reading(LEFT, tick * TICK_S)
        hands.pull(tick * TICK_S, WINDOW)
    assert hands.mask.tolist() == [False, True, False, True]
    assert hands.weights == pytest.approx([0.0, 1.0, 0.0, 0.5])
    assert hands.targets.shape == (8, len(JOINTS), 4)
    assert hands.targets[:, 1] == pytest.approx(np.tile(LEFT, (8, 1)))
    assert hands.targets[:, 3] == pytest.approx(np.tile(RIGHT, (8, 1)))
    assert np.linalg.norm(hands.targets, axis=-1) == pytest.approx(1.0)
    assert (hands.mask.dtype, hands.targets.dtype, hands.weights.dtype) == (bool, np.float32, np.float32)


def test_targets_have_no_sign_jumps_whatever_sign_the_readings_have() -> None:
    rng = np.random.default_rng(2)
    sensor, turning = WornSensor("lShldr"), TurningAxis("head", (1.0, 1.0, 0.0), 1.0)
    hands = Hands([sensor, turning], JOINTS)
    before = None
    for tick in range(400):
        reading = quaternion.from_axis_angle([0, 0, 1], 0.03 * tick).astype(np.float32)
        sensor.take_reading(reading * rng.choice([-1, 1]), tick * TICK_S)
        hands.pull(tick * TICK_S, WINDOW)
        if before is not None:
            assert np.sum(before * hands.targets, axis=-1).min() > 0.9
        before = hands.targets.copy()


def test_a_remote_set_from_another_thread_is_never_seen_half() -> None:
    remote = Remote("head")
    hands = Hands([remote], JOINTS)
    stop = threading.Event()

    def move() -> None:
        rng = np.random.default_rng(1)
        while not stop.is_set():
            remote.hold(random_quaternions(rng).tolist())

    thread = threading.Thread(target=move, daemon=True)
    thread.start()
    lengths = []
    try:
        for tick in range(3000):
            hands.pull(tick * TICK_S, WINDOW)
            lengths.append(np.linalg.norm(hands.targets[:, 3], axis=-1))
    finally:
        stop.set()
        thread.join()
    assert np.array(lengths) == pytest.approx(1.0, abs=1e-5)


def swinging_windows(ticks: int, degrees: float = 40.0) -> np.ndarray:
    """A phrase's windows (ticks, 8, joints, 4), in which all joints swing once a second."""
    angle = np.radians(degrees) * np.sin(math.tau * TICK_S * np.arange(ticks + 7))
    poses = np.repeat(quaternion.from_axis_angle([0.2, 0.3, 1.0], angle)[:, None], len(JOINTS), axis=1)
    return poses[np.arange(ticks)[:, None] + np.arange(8)].astype(np.float32)


def test_a_kept_joint_has_the_phrases_orientations_pose_by_pose() -> None:
    hands = Hands([Kept("head"), Kept("rShldr", weight=0.4), FixedOrientation("lShldr", LEFT)], JOINTS)
    windows = swinging_windows(80)
    for tick, window in enumerate(windows):
        hands.pull(tick * TICK_S, window)
    for place in (2, 3):
        assert np.array_equal(hands.targets[:, place], windows[-1][:, place])
    assert hands.targets[:, 1] == pytest.approx(np.tile(LEFT, (8, 1)))
    assert hands.weights == pytest.approx([0.0, 1.0, 0.4, 1.0])


def test_a_kept_joint_is_taken_and_let_go_as_any_other() -> None:
    kept = Kept("head")
    hands = Hands([kept], JOINTS)
    course = []
    for tick, window in enumerate(swinging_windows(120)):
        kept.enabled = tick < 50
        hands.pull(tick * TICK_S, window)
        course.append(hands.weights[3])
    assert course[24:26] == pytest.approx([1.0, 1.0], abs=0.01)
    assert course[50 + 24] == pytest.approx(0.5, abs=0.04)
    assert course[-1] == 0.0 and not hands.mask.any()
    assert np.abs(np.diff(course)).max() < 0.07


def test_a_kept_joints_signs_do_not_jump_where_the_windows_signs_do() -> None:
    hands, before = Hands([Kept("head")], JOINTS), None
    for tick, window in enumerate(swinging_windows(100)):
        hands.pull(tick * TICK_S, window * (-1.0 if tick // 10 % 2 else 1.0))
        if before is not None:
            assert np.sum(before * hands.targets[:, 3], axis=-1).min() > 0.9
        before = hands.targets[:, 3].copy()


def test_what_moved_a_joint_while_nothing_held_it_is_not_carried_on() -> None:
    """A dancer moves on while the hand is disabled: when it takes the joint, it has no motion yet."""
    sensor = WornSensor("lShldr")
    hands = Hands([sensor], JOINTS)
    sensor.enabled = False
    carried = []
    for tick in range(75):
        sensor.take_reading(quaternion.from_axis_angle([0, 1, 0], 0.12 * tick).tolist(), tick * TICK_S)
        sensor.enabled = tick >= 40
        hands.pull(tick * TICK_S, WINDOW)
        carried.append(float(quaternion.angle_between(hands.targets[-1, 1], hands.targets[0, 1])))
    assert max(carried[:42]) < 1e-3
    assert carried[-1] == pytest.approx(0.12 * 3.06, rel=0.05)


@pytest.mark.parametrize("seconds_per_turn", [2.0, -2.0, 5.0, -12.0])
@pytest.mark.parametrize("apart", [150.0, 175.0, -175.0])
def test_a_hand_that_comes_or_goes_near_the_phrases_opposite_does_not_turn_its_joint_over(
    seconds_per_turn: float, apart: float
) -> None:
    """Mixed with the phrase as the network does, by the short way, while the two pass opposites."""
    axis = np.array([0.0, 1.0, 0.0])
    hand = TurningAxis("lShldr", axis.tolist(), seconds_per_turn, turned=math.radians(apart))
    hands, danced = Hands([hand], JOINTS), []
    turns = quaternion.from_axis_angle(axis, -0.004 * np.arange(400))
    for tick in range(300):
        hand.enabled = 10 <= tick < 100 or 180 <= tick < 240
        window = np.repeat(turns[tick : tick + 8, None], len(JOINTS), axis=1).astype(np.float32)
        hands.pull(tick * TICK_S, window)
        danced.append(quaternion.slerp(window[0, 1], hands.targets[0, 1], float(hands.weights[1])))
    assert hands.weights[1] == 0.0 and hands.weights.shape == (4,)
    steps = quaternion.angle_between(np.array(danced[1:]), np.array(danced[:-1]))
    own = math.tau * TICK_S / abs(seconds_per_turn) + 0.004
    assert steps.max() < own + 1.6 * math.pi * TICK_S / TAKE_S  # half a turn at most, eased


def test_a_hand_that_holds_from_the_first_tick_leads_its_joint_from_the_phrase_too() -> None:
    both = quaternion.from_axis_angle([1.0, 0.0, 0.0], np.radians([90.0, 120.0]))
    raised, further = both.astype(np.float32)
    hands, danced = Hands([FixedOrientation("lShldr", further.tolist())], JOINTS), []
    for tick in range(40):
        hands.pull(tick * TICK_S, np.tile(raised, (8, len(JOINTS), 1)))
        danced.append(quaternion.slerp(raised, hands.targets[0, 1], float(hands.weights[1])))
    away = np.degrees(quaternion.angle_between(np.array(danced), raised))
    assert away[0] < 0.1 and away[-1] == pytest.approx(30.0, abs=0.1)
    assert np.diff(away).min() > -0.1 and np.diff(away).max() < 2.0


def held_course(hands: Hands, ticks: int, act: Callable[[int], None]) -> tuple[np.ndarray, np.ndarray]:
    """Targets (ticks, 8, 4) of the joint lShldr and whether it was held (ticks,)."""
    targets, held = [], []
    for tick in range(ticks):
        act(tick)
        hands.pull(tick * TICK_S, WINDOW)
        targets.append(hands.targets[:, 1].copy())
        held.append(bool(hands.mask[1]))
    return np.array(targets), np.array(held)


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(["turning", "sensor", "osc"]),
    st.integers(0, 2**32 - 1),
    st.floats(0.9, 20.0),
    st.lists(st.tuples(st.integers(10, 250), st.integers(6, 90)), max_size=3),
    st.lists(st.tuples(st.integers(10, 250), st.floats(0.0, 1.0)), max_size=3),
)
def test_a_smooth_hand_gives_smooth_targets(
    kind: str,
    seed: int,
    seconds_per_turn: float,
    pauses: list[tuple[int, int]],
    levels: list[tuple[int, float]],
) -> None:
    """Through whole revolutions, while it fades, and led over after a silence, also past the opposite of
    where it was: from one tick to the next no pose of a held joint's target jumps, as a rotation or by sign.
    """
    rng = np.random.default_rng(seed)
    axis, start = random_quaternions(rng, 2)
    turns = quaternion.from_axis_angle(axis[1:], math.tau * TICK_S / seconds_per_turn * np.arange(300))
    course = quaternion.multiply(turns, np.broadcast_to(start, (300, 4)))
    silent = {tick for first, length in pauses for tick in range(first, first + length)}
    hand: Puppeteer = {
        "turning": TurningAxis("lShldr", axis[1:].tolist(), seconds_per_turn),
        "sensor": WornSensor("lShldr"),
        "osc": Remote("lShldr"),
    }[kind]

    def act(tick: int) -> None:
        hand.weight = dict(levels).get(tick, hand.weight)
        hand.enabled = kind == "sensor" or tick not in silent
        if isinstance(hand, Remote):
            hand.hold((course[tick] * rng.choice([-1, 1])).tolist())
        elif isinstance(hand, WornSensor) and tick not in silent:
            hand.take_reading(course[tick] * rng.choice([-1, 1]), tick * TICK_S)

    targets, held = held_course(Hands([hand], JOINTS), 300, act)
    step = math.tau * TICK_S / seconds_per_turn
    led = 1.5 * math.pi * TICK_S / TAKE_S  # from the phrase and back: half a turn at most, eased
    both = held[1:] & held[:-1]
    moved = quaternion.angle_between(targets[1:], targets[:-1])[both]
    if len(moved):
        assert moved[:, 0].max() <= 1.05 * (step + led) + 1e-3
        assert (
            moved.max() <= 4.5 * (step + led) + 1e-3
        )  # its motion begins or ends: the last pose goes furthest
        assert np.sum(targets[1:] * targets[:-1], axis=-1)[both].min() > 0.0
    assert np.sum(targets[:, 1:] * targets[:, :-1], axis=-1).min() > 0.0


def test_a_joint_that_the_network_does_not_move_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(HandError, match=r"'lshoulder'.*'lShldr'.*hip, lShldr, rShldr, head"):
        Hands([WornSensor("lshoulder")], JOINTS)


def test_two_hands_on_one_joint_are_refused() -> None:
    with pytest.raises(HandError, match="Two hands hold 'head'"):
        Hands([Remote("head"), FixedOrientation("head", LEFT)], JOINTS)


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
    remote.let_go()
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
    remote.let_go()
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
    assert quaternion.angle_between(turns[1:], turns[:-1]).max() < 1.6 * apart * TICK_S / 0.5  # eased
    assert quaternion.angle_between(turns[-1], np.array(RIGHT)) < 1e-3


def test_readings_that_are_heard_right_after_a_stop_are_led_to_as_well() -> None:
    sensor = worn(1.0)
    sensor.take_reading(RIGHT, 1.7)
    turned = quaternion.angle_between(sensor.pull(1.7).orientation, np.array(LEFT))
    assert turned == pytest.approx(1.2 * ease(LONGEST_STEP_S / 0.5), rel=0.01)


def test_while_it_is_heard_the_target_is_the_newest_reading_at_once() -> None:
    sensor = worn(1.0)
    sensor.take_reading(RIGHT, 1.02)
    assert quaternion.angle_between(sensor.pull(1.02).orientation, np.array(RIGHT)) < 1e-3


def random_matrix(seed: int) -> np.ndarray:
    """(4, 4): turns a reading by two rotations and swaps its axes, as the matrix of a worn sensor does."""
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
    assert quaternion.angle_between(sensor.pull(1.0).orientation, before) < 1e-3
    shown = [before]
    for tick in range(51, 90):
        if tick > 50 + silence_s / TICK_S:
            sensor.take_reading(LEFT, tick * TICK_S)
        shown.append(sensor.pull(tick * TICK_S).orientation.copy())
    steps = quaternion.angle_between(np.array(shown[1:]), np.array(shown[:-1]))
    assert steps.max() < 1.7 * apart / 25  # eased over half a second
    assert quaternion.angle_between(shown[-1], after) < 1e-3


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
