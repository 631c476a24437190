"""Recordings: other rates, excerpts and the way out of a T-pose."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.recording import Recording, leading_tpose_frames
from appliance.pose.skeleton import Skeleton

SKELETON = Skeleton(("hip", "knee"), (-1, 0), np.array([[0.0, 0, 0], [0, -0.4, 0]]))


def turning(frames: int, fps: float, turns_per_second: float = 0.5) -> Recording:
    """The hip turns about the vertical at an even pace and walks one metre a second along x."""
    seconds = np.arange(frames) / fps
    poses = np.tile(quaternion.IDENTITY.astype(float), (frames, 2, 1))
    poses[:, 0] = quaternion.from_axis_angle([0, 1, 0], 2 * np.pi * turns_per_second * seconds)
    roots = np.stack([seconds, np.full(frames, 0.9), np.zeros(frames)], axis=-1)
    return Recording(SKELETON, quaternion.continuous(poses), roots, fps)


@pytest.mark.parametrize(("fps", "other"), [(120, 50), (60, 50), (50, 50), (24, 50), (29.97, 50), (50, 7)])
def test_resampling_keeps_pace_and_place(fps: float, other: float) -> None:
    before = turning(101, fps)
    after = before.resampled(other)
    seconds = np.arange(len(after)) / other
    assert after.fps == other
    assert 0 <= (len(before) - 1) / fps - seconds[-1] < 1 / other + 1e-9
    np.testing.assert_allclose(after.roots[:, 0], seconds, atol=1e-9)
    expected = quaternion.from_axis_angle([0, 1, 0], np.pi * seconds)
    assert quaternion.angle_between(after.poses[:, 0], expected).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(after.poses, axis=-1), 1, atol=1e-12)


def test_resampling_moves_stretching_bones_too() -> None:
    frames = 61
    translations = np.zeros((frames, 2, 3))
    translations[:, 1, 1] = np.linspace(-0.4, -0.6, frames)
    before = turning(frames, 60)
    after = Recording(SKELETON, before.poses, before.roots, 60, translations).resampled(50)
    assert after.translations is not None
    np.testing.assert_allclose(after.translations[:, 1, 1], np.linspace(-0.4, -0.6, 51), atol=1e-9)


def test_a_single_pose_can_be_resampled() -> None:
    assert len(turning(1, 60).resampled(50)) == 1


def test_excerpts_are_cut_by_the_clock() -> None:
    whole = turning(500, 50)
    assert whole.seconds == 10
    part = whole.excerpt(2.0, 3.5)
    assert part.seconds == 1.5
    np.testing.assert_array_equal(part.roots, whole.roots[100:175])
    assert len(whole.excerpt(9.0)) == len(whole.excerpt(9.0, 99.0)) == 50
    assert len(whole.excerpt(12.0)) == 0


def test_frames_can_be_left_out_at_the_start() -> None:
    whole = turning(10, 50)
    np.testing.assert_array_equal(whole.without_first(3).roots, whole.roots[3:])
    assert len(whole.without_first(99)) == 0


def leaving_a_tpose(*steps_degrees: float) -> Recording:
    """A hip that turns by the given steps and then holds still."""
    angles = np.radians(np.cumsum([0.0, *steps_degrees, *[0.5] * 30]))
    poses = np.tile(quaternion.IDENTITY.astype(float), (len(angles), 2, 1))
    poses[:, 0] = quaternion.from_axis_angle([1, 0, 0], angles)
    return Recording(SKELETON, poses, np.zeros((len(angles), 3)), 60)


@pytest.mark.parametrize(
    ("steps", "dropped"),
    [
        ((90.0,), 1),
        ((90.0, 27.0, 24.0, 17.0, 7.0, 1.0), 4),
        ((0.0, 0.0, 90.0, 12.0), 4),
        ((9.0, 24.0, 20.0, 12.0), 0),  # fast, but nobody jumped out of a rest pose
        ((), 0),
    ],
)
def test_the_tpose_goes_with_the_frames_that_swing_away_from_it(steps, dropped) -> None:
    assert leading_tpose_frames(leaving_a_tpose(*steps)) == dropped


def test_a_jump_later_on_is_no_tpose() -> None:
    assert leading_tpose_frames(leaving_a_tpose(*[1.0] * 12, 90.0)) == 0


def test_a_single_pose_has_no_tpose() -> None:
    assert leading_tpose_frames(turning(1, 60)) == 0
