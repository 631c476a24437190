"""Moving heads: they point at their target, through any pose, and never flip, jump or race."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from appliance.lights.head import LONGEST_STEP_S, Heads
from appliance.lights.patch import Patch
from tests.lights.rigs import lights

PERIOD_S = 0.025
ANGLES = st.floats(-180, 180)


def head(**changes: Any) -> Heads:
    fixture = {"name": "head", "profile": "moving-wash", "address": 1, "place": [0, 4, 0], **changes}
    return Patch(lights([fixture]).fixtures, None).heads


def follow(heads: Heads, point: Any, seconds: float = PERIOD_S) -> None:
    aims = np.array([point], float)
    heads.follow(heads.angles, aims, np.array([True]), seconds)


def settle(heads: Heads, point: Any) -> None:
    for _ in range(160):  # four seconds
        follow(heads, point)


def off_degrees(heads: Heads, point: Any) -> float:
    """Between the beam and the point."""
    wanted = np.array(point, float) - heads.places[0]
    cosine = heads.beams()[0] @ wanted / np.linalg.norm(wanted)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


@pytest.mark.parametrize(
    ("changes", "beam"),
    [
        ({"pose": "standing"}, (0, 1, 0)),
        ({"pose": "hanging"}, (0, -1, 0)),
        ({"pose": "standing", "turn": [0, 90, 0]}, (0, 0, 1)),  # pitched forwards: to the audience
        ({"pose": "standing", "turn": [0, 0, 90]}, (-1, 0, 0)),  # rolled: to the dancer's right
        ({"pose": "hanging", "turn": [90, 90, 0]}, (-1, 0, 0)),  # pitch throws it upstage, yaw to the right
    ],
)
def test_in_the_middle_of_its_range_a_head_shines_along_its_axis(
    changes: dict[str, Any], beam: tuple[float, ...]
) -> None:
    np.testing.assert_allclose(head(**changes).beams()[0], beam, atol=1e-6)


def test_tilt_leans_to_the_front_and_pan_turns_from_there_to_the_dancers_left() -> None:
    heads = head(pose="standing")
    heads.angles[:] = (0.0, 90.0)
    np.testing.assert_allclose(heads.beams()[0], (0, 0, 1), atol=1e-9)
    heads.angles[:] = (90.0, 90.0)
    np.testing.assert_allclose(heads.beams()[0], (1, 0, 0), atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(
    turn=st.tuples(ANGLES, st.floats(-90, 90), ANGLES),
    point=st.tuples(st.floats(-6, 6), st.floats(0, 2), st.floats(-6, 6)),
    pose=st.sampled_from(["hanging", "standing"]),
)
@example(turn=(0.0, 0.0, 0.125), point=(0.0, 0.0, 0.0), pose="hanging")
def test_any_point_in_reach_is_met_through_any_pose(
    turn: tuple[float, ...], point: tuple[float, ...], pose: str
) -> None:
    heads = head(turn=list(turn), pose=pose)
    away = np.array(point) - heads.places[0]
    along = (heads.local_from_world[0] @ away)[1] / np.linalg.norm(away)
    polar = np.degrees(np.arccos(np.clip(along, -1, 1)))
    for _ in range(400):  # 40 s: close to its own axis a head pans slowly
        follow(heads, point, LONGEST_STEP_S)
    assert off_degrees(heads, point) <= max(polar - 135.0, 0.0) + 0.1  # tilt ends at 135 degrees


@pytest.mark.parametrize("beside", [0.0, 0.001, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3])
@pytest.mark.parametrize("way", [(1, 0, 0), (0, 0, 1), (1, 0, -1)])
def test_a_path_under_the_head_is_followed_without_a_flip(beside: float, way: tuple[int, ...]) -> None:
    """Right under the head its pan could be anything; it must neither race nor lose the dancer."""
    heads = head()
    direction = np.array(way) / np.linalg.norm(way)
    aside = beside * np.cross(direction, [0, 1, 0])
    path = [direction * metres + aside + [0, 1, 0] for metres in np.arange(-3, 3, 1.5 * PERIOD_S)]
    settle(heads, path[0])
    before, worst = heads.angles.copy(), 0.0
    for point in path:
        follow(heads, point)
        assert (np.abs(heads.angles - before) <= heads.axes.slew * PERIOD_S + 1e-9).all()
        worst = max(worst, off_degrees(heads, point))
        before = heads.angles.copy()
    assert worst < 5.0


def test_through_the_zenith_pan_stays_and_tilt_changes_sides() -> None:
    heads = head()
    settle(heads, (0, 1, -2))
    pan = heads.angles[0]
    tilts = []
    for z in np.arange(-2, 2, 0.03):
        follow(heads, (0, 1, z))
        tilts.append(heads.angles[1])
        assert heads.angles[0] == pytest.approx(pan, abs=1e-6)
    assert tilts[0] * tilts[-1] < 0
    assert np.abs(np.diff(tilts)).max() < 2.0


def test_a_circling_dancer_is_followed_beyond_half_a_turn_and_unwound_at_the_end_of_the_range() -> None:
    """540 degrees: one and a half turns, then the other way of tilt takes over, half a turn back."""
    heads = head(pose="standing", place=[0, 0, 0])
    settle(heads, (0, 1, 2))
    pans = []
    for degrees in np.arange(0, 720, 1.0):  # 40 degrees a second
        angle = np.radians(degrees)
        follow(heads, (2 * np.sin(angle), 1, 2 * np.cos(angle)))
        pans.append(heads.angles[0])
    assert max(pans) == pytest.approx(270, abs=1.5)
    assert np.abs(np.diff(pans)).max() <= heads.axes.slew[0] * PERIOD_S + 1e-9
    unwound = int(np.argmax(pans))
    assert np.allclose(np.diff(pans[:unwound]), 1.0, atol=0.01)  # without a jump up to there
    assert pans[unwound + 60] < 170  # half a turn back, and on from there
    assert np.allclose(np.diff(pans[unwound + 60 : unwound + 150]), 1.0, atol=0.01)
    settle(heads, (2, 1, 0))
    assert off_degrees(heads, (2, 1, 0)) < 0.1


def test_the_shortest_way_is_taken_across_the_back() -> None:
    heads = head(pose="standing", place=[0, 0, 0])
    settle(heads, (0.5, 1, -2))  # 166 degrees
    before = heads.angles[0]
    settle(heads, (-0.5, 1, -2))  # -166 or 194 degrees
    assert abs(heads.angles[0] - before) < 30


def test_limits_hold_and_the_other_way_is_found_within_them() -> None:
    heads = head(pose="standing", place=[0, 0, 0], pan_limits=[-80, 80])
    settle(heads, (0, 1, -2))  # behind: pan 180, or pan 0 with tilt to the back
    assert abs(heads.angles[0]) <= 80
    assert off_degrees(heads, (0, 1, -2)) < 0.1
    tight = head(pose="standing", place=[0, 0, 0], pan_limits=[-80, 80], tilt_limits=[0, 90])
    settle(tight, (0, 1, -2))
    assert abs(tight.angles[0]) <= 80
    assert 0 <= tight.angles[1] <= 90


def test_no_head_is_faster_than_its_profile_says_even_after_a_pause() -> None:
    heads = head()
    follow(heads, (5, 0, 5), seconds=60.0)
    assert np.abs(heads.angles).max() <= 200 * 0.1 + 1e-9


def test_unsteady_points_right_under_the_head_hardly_move_its_pan() -> None:
    heads, shake = head(), np.random.default_rng(1)
    settle(heads, (0.0, 1, 0.0))
    pans = []
    for _ in range(200):
        follow(heads, (*(shake.normal(0, 0.005, 1)), 1.0, *(shake.normal(0, 0.005, 1))))
        pans.append(heads.angles[0])
    assert np.abs(np.diff(pans)).max() < 1.0


def test_a_head_that_tilts_far_follows_through_its_side_without_turning_over() -> None:
    """Below its own base a standing head must not swing over the top when pan lags behind."""
    heads = head(pose="standing", place=[0, 4, 0])
    settle(heads, (0, 2, 2.5))  # more than 90 degrees of tilt
    tilts = [heads.angles[1]]
    for degrees in np.arange(0, 120, 5.0):  # faster than it can pan
        angle = np.radians(degrees)
        follow(heads, (2.5 * np.sin(angle), 2, 2.5 * np.cos(angle)))
        tilts.append(heads.angles[1])
    assert min(tilts) > 0
    assert np.abs(np.diff(tilts)).max() <= 180 * PERIOD_S + 1e-9
