"""Where a root can be, and how fast it can get there."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose.possible import FARTHEST_M, FASTEST_M_S, impossible_frames, possible_roots


def walk(frames: int = 100, fps: float = 50.0) -> np.ndarray:
    """Four metres a second along x."""
    path = np.zeros((frames, 3))
    path[:, 0], path[:, 1] = 4.0 * np.arange(frames) / fps, 0.9
    return path


@pytest.mark.parametrize("fps", [10.0, 50.0, 240.0])
def test_a_path_that_somebody_can_walk_is_left_as_it_is(fps: float) -> None:
    path = walk(fps=fps)
    assert not len(impossible_frames(path, fps))
    assert possible_roots(path, fps) is path


def test_the_noise_of_quick_capture_is_no_jump() -> None:
    path = walk(fps=1000.0)
    path[::2] += 0.1
    assert not len(impossible_frames(path, 1000.0))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("far", [FASTEST_M_S * 0.03, -40.0, 1e30, 1e308])
def test_a_jump_is_named_and_the_path_goes_on_from_where_it_was(axis: int, far: float) -> None:
    path = walk()
    path[40:, axis] += far
    assert impossible_frames(path, 50.0).tolist() == [40]
    found = possible_roots(path, 50.0)
    assert np.isfinite(found).all()
    if abs(far) < 100.0:
        wanted = walk() - np.outer(np.arange(100) >= 40, [4.0 / 50.0, 0.0, 0.0])
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_a_jump_there_and_back_leaves_the_rest_of_the_path_in_its_place() -> None:
    path = walk()
    path[40:45, 2] -= 30.0
    assert impossible_frames(path, 50.0).tolist() == [40, 45]
    assert np.abs(possible_roots(path, 50.0) - walk()).max() < 0.2


@pytest.mark.parametrize("place", [FARTHEST_M * 1.1, 1e38, np.nan, np.inf])
def test_a_start_outside_the_world_is_named_and_becomes_the_middle(place: float) -> None:
    path = walk()
    path[:, 0] += place
    assert impossible_frames(path, 50.0)[0] == 0
    found = possible_roots(path, 50.0)
    assert np.isfinite(found).all() and np.abs(found).max() < 10.0
