"""Playback: the phrase itself, endless, and no seam whatever is changed while it runs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.dancer.grounding import Floor
from appliance.dancer.loop import Loop, Placement, yaws
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase import PhraseError
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from tests.dancer.conftest import random_quaternions


def played(playback: Playback, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """First poses (ticks, J, 4) and roots (ticks, 3) of the windows of so many ticks."""
    poses, roots = [], []
    for _ in range(ticks):
        poses.append(playback.window()[0].copy())
        roots.append(playback.roots()[0].copy())
        playback.advance()
    return np.array(poses), np.array(roots)


def fastest_step(poses: np.ndarray) -> float:
    """Largest turn (radians) of any joint from one tick to the next."""
    return float(quaternion.angle_between(poses[1:], poses[:-1]).max())


def fastest_move(roots: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(roots, axis=0), axis=1).max())


def test_the_window_is_the_next_eight_poses_of_the_phrase(swaying: Recording) -> None:
    playback = Playback(swaying, crossfade_s=0.5)
    for tick in range(100):
        assert playback.window().shape == (8, len(swaying.skeleton), 4)
        assert playback.window().dtype == np.float32
        assert quaternion.angle_between(playback.window(), swaying.poses[tick : tick + 8]).max() < 1e-3
        assert np.abs(playback.roots() - swaying.roots[tick : tick + 8]).max() < 1e-5
        assert playback.position_s == pytest.approx(tick / 50)
        playback.advance()


def test_windows_of_neighbouring_ticks_share_their_poses(walking: Recording) -> None:
    playback = Playback(walking, rate=1.3)
    for _ in range(1000):
        window, roots = playback.window().copy(), playback.roots().copy()
        playback.advance()
        assert np.array_equal(playback.window()[:-1], window[1:])
        assert np.array_equal(playback.roots()[:-1], roots[1:])


def test_a_loop_has_no_seam(open_ended: Recording) -> None:
    poses, roots = played(Playback(open_ended), 1500)
    # The crossfade adds the difference of the poses over half a second, 1.5 times that where it is steep.
    difference = quaternion.angle_between(open_ended.poses[-25:], open_ended.poses[:25]).max()
    assert difference > 0.5
    assert fastest_step(poses) < fastest_step(open_ended.poses) + 1.5 * difference / 25
    assert fastest_move(roots) < 1.5 * fastest_move(open_ended.roots)
    assert np.sum(poses[1:] * poses[:-1], axis=-1).min() > 0.9


def test_a_closed_phrase_is_played_round_and_round_as_it_is(swaying: Recording) -> None:
    poses, roots = played(Playback(swaying), 650)
    index = np.arange(650) % 200
    assert quaternion.angle_between(poses, swaying.poses[index]).max() < 1e-3
    assert np.abs(roots - swaying.roots[index]).max() < 1e-5


def test_a_path_that_nearly_comes_back_stays_where_it_is_for_ever(open_ended: Recording) -> None:
    _, roots = played(Playback(open_ended), 40 * 195)
    assert np.abs(roots[-195:] - roots[195:390]).max() < 1e-3


def test_a_small_miss_of_position_and_heading_is_closed(open_ended: Recording) -> None:
    drift = np.linspace(0.0, 1.0, len(open_ended))
    turn = quaternion.from_axis_angle([0.0, 1.0, 0.0], 0.03 * drift)
    poses = open_ended.poses.copy()
    poses[:, 0] = quaternion.multiply(turn, poses[:, 0])
    roots = open_ended.roots + drift[:, None] * np.array([0.08, 0.0, 0.05])
    playback = Playback(Recording(open_ended.skeleton, poses, roots, 50.0))
    out, places = played(playback, 30 * 195)
    assert np.abs(places[-195:] - places[195:390]).max() < 1e-3
    assert quaternion.angle_between(out[-195:], out[195:390]).max() < 1e-3
    assert fastest_move(places) < 1.5 * fastest_move(open_ended.roots)


def test_a_walk_goes_on_from_where_it_was_in_the_direction_it_had(walking: Recording) -> None:
    poses, roots = played(Playback(walking), 5 * 175)
    assert fastest_move(roots) < 1.3 * fastest_move(walking.roots)
    assert fastest_step(poses) < 1.6 * fastest_step(walking.poses)
    heading = np.unwrap(yaws(poses[:, 0].astype(np.float64)))
    assert heading[-1] - heading[0] == pytest.approx(5 * 175 / 200 * np.pi / 2, rel=0.02)
    ground = roots[
        50::175, [0, 2]
    ]  # one point a loop: each leg as long as the first, turned by the same angle
    legs = np.diff(ground, axis=0)
    assert np.linalg.norm(legs, axis=1) == pytest.approx(np.linalg.norm(legs[0]), rel=0.01)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whatever_is_changed_while_it_runs_nothing_jumps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.arange(300) / 50
    phrase = smooth_phrase(rng, time_s)
    playback = Playback(phrase, crossfade_s=0.5)
    poses, roots = [], []
    for tick in range(1200):
        if rng.random() < 0.02:
            change = rng.integers(3)
            if change == 0:
                playback.jump(rng.uniform(-1, 7))
            elif change == 1:
                start = rng.uniform(0, 4)
                playback.excerpt(start, start + rng.uniform(0.2, 3))
            else:
                playback.rate = rng.uniform(-1.5, 1.5)
        assert np.isfinite(playback.window()).all(), tick
        poses.append(playback.window()[0].copy())
        roots.append(playback.roots()[0].copy())
        playback.advance()
    out, places = np.array(poses), np.array(roots)
    assert np.abs(np.linalg.norm(out, axis=-1) - 1).max() < 1e-5
    # 1.5 times the phrase in two heads, and between them a crossfade of poses that are at most pi apart:
    # 1.5 * pi / 25 rad a tick where it is steepest, and as much again where a loop's own crossfade meets it.
    assert fastest_step(out) < 3 * fastest_step(phrase.poses) + 1.5 * np.pi / 25 * 2.5
    assert fastest_move(places) < 3 * fastest_move(phrase.roots) + 0.02
    assert np.sum(out[1:] * out[:-1], axis=-1).min() > 0.0


def smooth_phrase(rng: np.random.Generator, time_s: np.ndarray) -> Recording:
    """Random, smooth, slow motion of a three-joint chain that wanders over the floor."""
    from appliance.pose.skeleton import Skeleton

    skeleton = Skeleton(("hip", "chest", "head"), (-1, 0, 1), np.array([[0, 0, 0], [0, 0.4, 0], [0, 0.3, 0]]))
    axes = rng.normal(size=(3, 3))
    angles = [a * np.sin(b * time_s + c) for a, b, c in rng.uniform(0.2, 1.5, size=(3, 3))]
    poses = np.stack([quaternion.from_axis_angle(axes[j], angles[j]) for j in range(3)], axis=1)
    roots = np.stack([np.sin(time_s), np.full_like(time_s, 0.9), 0.3 * time_s], axis=1)
    return Recording(skeleton, poses, roots, 50.0)


def test_a_jump_arrives_at_its_place_and_says_so(swaying: Recording) -> None:
    playback = Playback(swaying, crossfade_s=0.2)
    played(playback, 20)
    playback.jump(3.0)
    playback.advance()
    assert playback.jumped
    playback.advance()
    assert not playback.jumped
    poses, roots = played(playback, 30)
    # The window's far end was at 3.00 s in the first tick; its near end comes there 7 ticks later.
    assert quaternion.angle_between(poses[-1, 1:], swaying.poses[150 + 29 + 1 - 7, 1:]).max() < 1e-3
    assert fastest_move(roots) < 2.5 * fastest_move(swaying.roots)


def test_a_jump_keeps_position_and_heading_of_the_figure(walking: Recording) -> None:
    playback = Playback(walking, crossfade_s=0.3)
    before_poses, before_roots = played(playback, 150)
    playback.jump(0.0)
    poses, roots = played(playback, 60)
    assert fastest_move(np.concatenate([before_roots, roots])) < 0.035
    heading = np.unwrap(yaws(np.concatenate([before_poses, poses])[:, 0].astype(np.float64)))
    assert np.abs(np.diff(heading)).max() < 0.02


def test_the_last_of_several_jumps_during_a_crossfade_counts(swaying: Recording) -> None:
    playback = Playback(swaying, crossfade_s=0.4)
    for to_s in (1.0, 2.0, 3.5, 2.5):
        playback.jump(to_s)
        playback.advance()
    jumped_at = []
    for tick in range(60):
        playback.advance()
        if playback.jumped:
            jumped_at.append((tick, playback.position_s))
    assert len(jumped_at) == 1
    assert playback.position_s == pytest.approx(2.5 + (59 - jumped_at[0][0] - 7) / 50, abs=0.03)


def test_the_rate_stretches_time(swaying: Recording) -> None:
    half = Playback(swaying, rate=0.5)
    poses, roots = played(half, 201)
    assert quaternion.angle_between(poses[::2], swaying.poses[:101]).max() < 1e-3
    middle = quaternion.slerp(swaying.poses[:100], swaying.poses[1:101], np.full((100, 1), 0.5))
    assert quaternion.angle_between(poses[1:200:2], middle).max() < 1e-3
    assert np.abs(np.diff(roots, axis=0)).max() < 0.55 * fastest_move(swaying.roots)


def test_backwards_is_the_phrase_backwards(open_ended: Recording) -> None:
    period = 195
    playback = Playback(open_ended, rate=-1.0, crossfade_s=0.5)
    start, _ = played(playback, 100)
    poses, roots = played(playback, 400)
    at = round(playback.position_s * 50)
    forward, _ = played(Playback(open_ended, crossfade_s=0.5), 3 * period)
    expected = forward[period : 2 * period][(at + np.arange(400, 0, -1)) % period]
    assert quaternion.angle_between(poses[:, 1:], expected[:, 1:]).max() < 1e-3
    both = np.concatenate([start, poses])
    assert fastest_step(both) < 1.6 * fastest_step(open_ended.poses)
    assert fastest_move(roots) < 1.5 * fastest_move(open_ended.roots)


def test_rate_zero_stands_still_and_rate_one_goes_on(swaying: Recording) -> None:
    playback = Playback(swaying)
    played(playback, 50)
    playback.rate = 0.0
    played(playback, 30)
    poses, roots = played(playback, 50)
    assert fastest_step(poses) < 1e-6
    assert fastest_move(roots) == 0.0
    playback.rate = 1.0
    played(playback, 30)
    poses, _ = played(playback, 50)
    assert fastest_step(poses) > 0.5 * fastest_step(swaying.poses)


def test_an_excerpt_plays_nothing_but_itself(swaying: Recording) -> None:
    playback = Playback(swaying, start_s=1.0, end_s=2.0, crossfade_s=0.2)
    places = []
    for _ in range(300):
        places.append(playback.position_s)
        playback.advance()
    assert min(places) >= 1.0
    assert max(places) < 2.0
    playback.excerpt(2.0, 3.0)
    played(playback, 40)
    assert 2.0 <= playback.position_s < 3.0


def test_a_recording_at_another_rate_is_resampled(swaying: Recording) -> None:
    fast = swaying.resampled(120.0)
    poses, _ = played(Playback(fast), 150)
    assert quaternion.angle_between(poses[:, 1:], swaying.poses[:150, 1:]).max() < 0.01


def test_the_lift_is_carried_along_with_its_pose(swaying: Recording) -> None:
    lifts = np.arange(200, dtype=np.float32) / 1000
    playback = Playback(swaying, floor=Floor(np.zeros(4, np.float32), lifts))
    for tick in range(100):
        assert playback.lift == pytest.approx(tick / 1000, abs=1e-6)
        playback.advance()


def test_a_phrase_shorter_than_a_window_is_refused_with_the_numbers(swaying: Recording) -> None:
    with pytest.raises(PhraseError, match=r"7 poses.*needs 8"):
        Playback(swaying.excerpt(0.0, 0.14))
    playback = Playback(swaying)
    with pytest.raises(PhraseError, match="needs 8"):
        playback.excerpt(3.95)
    played(playback, 20)
    assert 0.3 < playback.position_s < 0.5  # it goes on with what it played


def test_a_phrase_of_exactly_one_window_dances_on(swaying: Recording) -> None:
    poses, _ = played(Playback(swaying.excerpt(0.0, 0.16)), 200)
    assert np.isfinite(poses).all()
    assert fastest_step(poses) < 2 * fastest_step(swaying.poses)


@pytest.mark.parametrize("rate", [5.0, -4.1, float("nan")])
def test_a_rate_out_of_bounds_is_refused(swaying: Recording, rate: float) -> None:
    with pytest.raises(ValueError, match="from -4 to 4"):
        Playback(swaying, rate=rate)


def test_controlled_at_each_tick_it_dances_on(swaying: Recording) -> None:
    playback = Playback(swaying, crossfade_s=0.1)
    rng = np.random.default_rng(5)
    poses = []
    for _ in range(2000):
        playback.jump(rng.uniform(0, 4))
        playback.excerpt(0.0, rng.uniform(1, 4))
        playback.rate = rng.uniform(-2, 2)
        poses.append(played(playback, 1)[0])
    assert np.abs(np.linalg.norm(np.concatenate(poses), axis=-1) - 1).max() < 1e-5


def test_placements_chain_and_undo() -> None:
    a, b = Placement(0.7, 1.0, -2.0), Placement(-1.9, 0.3, 0.4)
    x, z = a.after(b).point(0.5, 0.6)
    assert (x, z) == pytest.approx(a.point(*b.point(0.5, 0.6)))
    assert a.inverse.point(*a.point(0.5, 0.6)) == pytest.approx((0.5, 0.6))
    turned = quaternion.rotate(quaternion.from_axis_angle([0, 1, 0], 0.7), np.array([0.5, 0.0, 0.6]))
    assert Placement(0.7).point(0.5, 0.6) == pytest.approx((turned[0], turned[2]))


def test_a_loop_without_crossfade_ends_where_it_ends() -> None:
    poses = random_quaternions(np.random.default_rng(1), 20, 3)
    loop = Loop(poses, np.zeros((20, 4), dtype=np.float32), 0)
    assert loop.period == 20
    assert np.allclose(loop.poses[:20, 1:], poses[:, 1:])
