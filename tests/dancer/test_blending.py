"""Overlapping windows become one motion: exact where they agree, continuous where they do not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.dancer.blending import Blending, Shape
from appliance.pose import quaternion
from tests.dancer.conftest import random_quaternions

HOPS = range(1, 9)
WINDOW, JOINTS, TICKS = 8, 5, 600


def turning(ticks: int, joints: int = JOINTS) -> np.ndarray:
    """A motion (ticks, joints, 4) that turns each joint on and on, at different speeds."""
    angle = np.outer(np.arange(ticks) * 0.02, np.linspace(0.5, 5.0, joints))
    return quaternion.from_axis_angle([0.3, 1.0, -0.4], angle).astype(np.float32)


SHAPES = ("prompt", "hann")


def blended(motion: np.ndarray, hop: int, shape: Shape) -> np.ndarray:
    """What comes out when the window of each due tick is cut out of one motion."""
    blending = Blending(motion.shape[1], WINDOW, hop, shape)
    out = []
    for tick in range(len(motion) - WINDOW):
        if blending.is_due:
            blending.add(motion[tick : tick + WINDOW])
        out.append(blending.take().copy())
    return np.array(out)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("hop", HOPS)
def test_windows_that_agree_give_the_motion_itself(hop: int, shape: Shape) -> None:
    motion = turning(TICKS)
    out = blended(motion, hop, shape)
    assert np.degrees(quaternion.angle_between(out, motion[: len(out)])).max() < 0.02


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("hop", HOPS)
def test_a_constant_pose_stays_constant(hop: int, shape: Shape) -> None:
    pose = random_quaternions(np.random.default_rng(3), JOINTS)
    out = blended(np.repeat(pose[None], TICKS, axis=0), hop, shape)
    assert np.abs(out - out[0]).max() < 2e-6
    assert quaternion.angle_between(out, pose).max() < 1e-5


@pytest.mark.parametrize("hop", HOPS)
def test_a_window_is_due_every_hop_ticks(hop: int) -> None:
    blending = Blending(JOINTS, WINDOW, hop)
    due = []
    for tick in range(50):
        if blending.is_due:
            due.append(tick)
            blending.add(turning(WINDOW))
        blending.take()
    assert due == list(range(0, 50, hop))


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_signs_of_the_windows_do_not_matter_and_never_jump(seed: int, hop: int) -> None:
    rng = np.random.default_rng(seed)
    motion = turning(80)
    plain, flipped = Blending(JOINTS, WINDOW, hop), Blending(JOINTS, WINDOW, hop)
    before = None
    for tick in range(60):
        if plain.is_due:
            window = motion[tick : tick + WINDOW]
            plain.add(window)
            flipped.add(window * rng.choice([-1.0, 1.0], size=(WINDOW, JOINTS, 1)).astype(np.float32))
        a, b = plain.take().copy(), flipped.take().copy()
        assert quaternion.angle_between(a, b).max() < 1e-3
        if before is not None:
            assert np.sum(before * b, axis=-1).min() > 0.9
        before = b


@pytest.mark.parametrize(
    ("shape", "hop", "largest"),
    [
        ("hann", 1, 0.27),
        ("hann", 2, 0.42),
        ("hann", 3, 0.6),
        ("hann", 4, 0.75),
        ("prompt", 1, 0.34),
        ("prompt", 2, 0.49),
        ("prompt", 3, 0.6),
        ("prompt", 4, 0.75),
    ],
)
def test_a_sudden_change_of_the_windows_is_spread_over_their_overlap(
    shape: Shape, hop: int, largest: float
) -> None:
    """From one pose to another, 1 rad away, between two windows: no step of the output takes it at once."""
    blending = Blending(1, WINDOW, hop, shape)
    angles = []
    for tick in range(100):
        if blending.is_due:
            angle = 0.0 if tick < 40 else 1.0
            pose = quaternion.from_axis_angle([0, 1, 0], np.full((WINDOW, 1), angle))
            blending.add(pose.astype(np.float32))
        angles.append(float(quaternion.angle_between(blending.take()[0], quaternion.IDENTITY)))
    steps = np.diff(angles)
    assert steps.min() > -1e-5
    assert angles[-1] == pytest.approx(1.0, abs=1e-5)
    assert steps.max() < largest


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("prompt", [0.33, 0.61, 0.81, 0.93, 0.98, 1.0, 1.0, 1.0]),
        ("hann", [0.01, 0.09, 0.26, 0.50, 0.74, 0.91, 0.99, 1.0]),
    ],
)
def test_a_target_step_reaches_the_output_as_the_docstring_says(shape: Shape, expected: list[float]) -> None:
    blending = Blending(1, WINDOW, 1, shape)
    shares = []
    for tick in range(40):
        angle = 0.0 if tick < 20 else 0.5
        blending.add(quaternion.from_axis_angle([1, 0, 0], np.full((WINDOW, 1), angle)).astype(np.float32))
        pose = blending.take()[0]
        if tick >= 20:
            shares.append(float(quaternion.angle_between(pose, quaternion.IDENTITY)) / 0.5)
    assert shares[:8] == pytest.approx(expected, abs=0.006)


def test_without_windows_the_motion_runs_out_and_the_last_pose_is_held() -> None:
    blending = Blending(JOINTS, WINDOW, 1)
    motion = turning(WINDOW)
    blending.add(motion)
    out = np.array([blending.take().copy() for _ in range(300)])
    assert quaternion.angle_between(out[:WINDOW], motion).max() < 1e-3
    assert quaternion.angle_between(out[WINDOW:], motion[-1]).max() < 1e-3


def test_the_hop_can_change_while_running() -> None:
    motion = turning(TICKS)
    blending = Blending(JOINTS, WINDOW, 1)
    for tick in range(TICKS - WINDOW):
        blending.hop = 1 + (tick // 20) % 8
        if blending.is_due:
            blending.add(motion[tick : tick + WINDOW])
        assert np.degrees(quaternion.angle_between(blending.take(), motion[tick])).max() < 0.05


@pytest.mark.parametrize("hop", [0, 9, -1])
def test_a_hop_beyond_the_window_is_refused(hop: int) -> None:
    with pytest.raises(ValueError, match="1 to 8"):
        Blending(JOINTS, WINDOW, hop)
