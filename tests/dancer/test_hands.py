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
from appliance.dancer.puppeteers import FixedOrientation, Kept, Puppeteer, Remote, TurningAxis, WornSensor
from appliance.pose import quaternion
from tests.dancer.conftest import random_quaternions
from tests.dancer.pulled import LEFT, RIGHT, TICK_S, worn

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
    for tick in range(60):
        sensor.take_reading(quaternion.from_axis_angle([0, 1, 0], 0.12 * tick).tolist(), tick * TICK_S)
        sensor.enabled = tick >= 40
        hands.pull(tick * TICK_S, WINDOW)
        carried.append(float(quaternion.angle_between(hands.targets[-1, 1], hands.targets[0, 1])))
    assert max(carried[:42]) < 1e-3
    assert carried[-1] == pytest.approx(0.12 * 3.06, rel=0.05)


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
    led = math.pi * TICK_S / 0.5 if kind == "sensor" else 0.0  # half a turn in half a second
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
