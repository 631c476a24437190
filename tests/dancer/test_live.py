"""A live dancer in place of the phrase: smooth at any rate, no sign jumps, gone when it is silent."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.box.snapshot import packed, restore
from appliance.dancer.live import SILENT_S, Live
from appliance.pose import quaternion
from tests.dancer.conftest import random_quaternions

JOINTS, WINDOW, TICK_S = 5, 8, 0.02
NOWHERE = np.full(3, math.nan, dtype=np.float32)
STILL = np.tile(quaternion.IDENTITY, (WINDOW, JOINTS, 1))
ROOTS = np.tile(np.array([1.0, 0.9, 2.0], dtype=np.float32), (WINDOW, 1))


def pose(angle: float) -> np.ndarray:
    """All joints turned by an angle (radians) about one axis."""
    turned = quaternion.from_axis_angle([0.3, 1.0, -0.4], np.full(JOINTS, angle))
    return turned.astype(np.float32)


def angles(window: np.ndarray) -> np.ndarray:
    """(T,): how far the poses of a window are from the rest, radians."""
    found: np.ndarray = quaternion.angle_between(window, STILL[: len(window)]).mean(axis=-1)
    return found


def chosen(fade_s: float = 0.0) -> Live:
    live = Live(JOINTS, WINDOW)
    live.choose(True, fade_s)
    return live


def test_until_it_is_chosen_the_phrase_is_untouched() -> None:
    live = Live(JOINTS, WINDOW)
    assert live.hear(pose(1.0), NOWHERE, 0.0, STILL[0])
    window, roots = live.lay_over(0.0, STILL, ROOTS)
    assert window is STILL and roots is ROOTS


def test_it_fades_in_and_out_over_its_time() -> None:
    live, course = chosen(1.0), []
    for tick in range(150):
        now = tick * TICK_S
        live.hear(pose(1.0), NOWHERE, now, STILL[0])
        if tick == 75:
            live.choose(False, 0.5)
        course.append(angles(live.lay_over(now, STILL, ROOTS)[0])[0])
    assert course[0] < 0.01
    assert course[24] == pytest.approx(0.5, abs=0.02)
    assert course[60] == pytest.approx(1.0, abs=1e-3)
    assert course[-1] == 0.0
    assert np.abs(np.diff(course)).max() < 1.5 / 25  # no jump: the fade out takes 25 ticks


@pytest.mark.parametrize("apart", [2.0, 2.8, -2.8])
def test_a_dancer_who_passes_the_phrases_opposite_in_a_fade_turns_nothing_over(apart: float) -> None:
    """Both turn, at different rates: the short way from one to the other would change sides."""
    live, shown = Live(JOINTS, WINDOW), []
    for tick in range(400):
        now = tick * TICK_S
        phrase = np.tile(pose(-0.6 * now), (WINDOW, 1, 1))
        live.hear(pose(apart + 0.6 * now), NOWHERE, now, phrase[0])
        if tick in (20, 220):
            live.choose(tick == 20, 2.0)
        shown.append(live.lay_over(now, phrase, ROOTS)[0][0].copy())
    steps = quaternion.angle_between(np.array(shown[1:]), np.array(shown[:-1]))
    assert steps.max() < 0.6 * TICK_S + 1.6 * (math.pi + 2.4) * TICK_S / 2.0  # apart at most, eased


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 90.0, 120.0])
def test_a_steady_turn_stays_steady_at_any_rate_of_the_stream(rate: float) -> None:
    """Poses that come at 24 a second would otherwise show as stairs at 50."""
    live, course, sent = chosen(), [], 0
    for tick in range(200):
        now = tick * TICK_S
        while sent / rate <= now:
            live.hear(pose(0.5 * sent / rate), NOWHERE, sent / rate, STILL[0])
            sent += 1
        course.append(angles(live.lay_over(now, STILL, ROOTS)[0])[0])
    steps = np.diff(course[100:])
    assert steps.mean() == pytest.approx(0.5 * TICK_S, rel=0.02)
    assert steps.std() < 0.12 * steps.mean()
    assert 199 * TICK_S - course[-1] / 0.5 < 1.2 / rate  # seconds behind


def test_later_poses_of_the_window_go_on_as_the_dancer_does() -> None:
    live = chosen()
    for tick in range(50):
        live.hear(pose(0.04 * tick), NOWHERE, tick * TICK_S, STILL[0])
        window = live.lay_over(tick * TICK_S, STILL, ROOTS)[0]
    ahead = np.diff(angles(window))
    assert (ahead > 0).all() and ahead[0] == pytest.approx(0.04, rel=0.1)


def test_a_silent_stream_gives_way_to_the_phrase_and_comes_back() -> None:
    live = chosen(0.2)
    for tick in range(50):
        live.hear(pose(1.0), NOWHERE, tick * TICK_S, STILL[0])
        live.lay_over(tick * TICK_S, STILL, ROOTS)
    assert live.share == 1.0
    ticks_to_silence = round(SILENT_S / TICK_S)
    shares = []
    for tick in range(50, 50 + ticks_to_silence + 20):
        live.lay_over(tick * TICK_S, STILL, ROOTS)
        shares.append(live.share)
    assert min(shares[: ticks_to_silence - 2]) == 1.0
    assert shares[-1] == 0.0
    now = (50 + ticks_to_silence + 20) * TICK_S
    for tick in range(20):
        live.hear(pose(0.5), NOWHERE, now + tick * TICK_S, STILL[0])
        window = live.lay_over(now + tick * TICK_S, STILL, ROOTS)[0]
    assert angles(window)[0] == pytest.approx(0.5, abs=1e-3)


def test_the_figure_goes_where_the_stream_goes_from_where_it_stood() -> None:
    live = chosen(0.2)
    for tick in range(100):
        root = np.array([10.0 + 0.01 * tick, 5.0, 0.0], dtype=np.float32)
        live.hear(pose(0.1), root, tick * TICK_S, STILL[0])
        roots = live.lay_over(tick * TICK_S, STILL, ROOTS)[1]
        if tick == 0:
            assert roots[0] == pytest.approx(ROOTS[0], abs=1e-3)
    assert roots[0] == pytest.approx([1.98, 0.9, 2.0], abs=0.015)


def test_without_a_root_the_figure_stays_on_the_phrases_path() -> None:
    live = chosen()
    live.hear(pose(0.1), NOWHERE, 0.0, STILL[0])
    assert np.array_equal(live.lay_over(0.0, STILL, ROOTS)[1], ROOTS)


@given(st.integers(0, 2**32 - 1))
def test_signs_never_jump_whatever_the_stream_sends(seed: int) -> None:
    rng, live, before = np.random.default_rng(seed), chosen(0.1), None
    for tick in range(60):
        signs = rng.choice([-1.0, 1.0], size=(JOINTS, 1)).astype(np.float32)
        live.hear(pose(0.05 * tick) * signs, NOWHERE, tick * TICK_S, STILL[0])
        window = live.lay_over(tick * TICK_S, STILL, ROOTS)[0].copy()
        if before is not None:
            assert np.sum(before * window, axis=-1).min() > 0.9
        assert np.linalg.norm(window, axis=-1) == pytest.approx(1.0, abs=1e-5)
        before = window


@pytest.mark.parametrize("wrong", [0.0, 2.0, math.inf])
def test_what_is_no_pose_is_refused(wrong: float) -> None:
    live, bad = chosen(), pose(1.0)
    bad[2] = wrong
    assert not live.hear(bad, NOWHERE, 0.0, STILL[0])
    bad[2, 3] = math.nan  # a torn joint is none that does not come
    assert not live.hear(bad, NOWHERE, 0.0, STILL[0])
    assert not live.hear(np.full_like(bad, math.nan), NOWHERE, 0.0, STILL[0])
    assert live.lay_over(0.0, STILL, ROOTS)[0] is STILL


def partial(angle: float, *missing: int) -> np.ndarray:
    """A pose without these joints."""
    found = pose(angle)
    found[[*missing]] = math.nan
    return found


def test_joints_that_do_not_come_stay_with_the_phrase() -> None:
    live = chosen(0.2)
    phrase = np.tile(quaternion.from_axis_angle([0.0, 0.0, 1.0], 0.7), (WINDOW, JOINTS, 1)).astype(np.float32)
    for tick in range(50):
        assert live.hear(partial(1.0, 1, 4), NOWHERE, tick * TICK_S, phrase[0])
        window = live.lay_over(tick * TICK_S, phrase, ROOTS)[0]
    stays = quaternion.angle_between(window, phrase).max(axis=0)
    assert stays[[1, 4]] == pytest.approx(0.0, abs=1e-3)
    assert quaternion.angle_between(window[0], pose(1.0))[[0, 2, 3]] == pytest.approx(0.0, abs=1e-3)
    assert live.share_of([1, 4]) == 0.0 and live.share_of([0, 2]) == 1.0


def test_a_joint_that_no_longer_comes_goes_back_to_the_phrase_without_a_jump() -> None:
    live, course = chosen(), []
    for tick in range(200):
        now = tick * TICK_S
        live.hear(partial(1.0, 2) if 60 <= tick < 120 else pose(1.0), NOWHERE, now, STILL[0])
        window = live.lay_over(now, STILL, ROOTS)[0]
        course.append(quaternion.angle_between(window[0], STILL[0]))
    turned = np.array(course)
    assert turned[50] == pytest.approx(1.0, abs=1e-3) and turned[-1] == pytest.approx(1.0, abs=1e-3)
    assert turned[115, 2] == pytest.approx(0.0, abs=1e-3)
    assert turned[115, [0, 1, 3, 4]] == pytest.approx(1.0, abs=1e-3)
    assert np.abs(np.diff(turned[2:], axis=0)).max() < 1.6 / 25  # half a second of 25 ticks, eased


@pytest.mark.parametrize("jump", [30.0, -900.0])
@pytest.mark.parametrize("lasts", [1, 5, 1000])
def test_a_root_that_jumps_takes_the_figure_nowhere(jump: float, lasts: int) -> None:
    live, path = chosen(), []
    for tick in range(150):
        root = np.array([0.01 * tick, 0.9, jump * (60 <= tick < 60 + lasts)], dtype=np.float32)
        live.hear(pose(0.1), root, tick * TICK_S, STILL[0])
        path.append(live.lay_over(tick * TICK_S, STILL, ROOTS)[1][0].copy())
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.03
    assert path[-1] == pytest.approx([1.0 + 1.48, 0.9, 2.0], abs=0.05)
    assert live.jumps == (1 if lasts == 1000 else 2)


@pytest.mark.parametrize("far", [2e3, 3e38, math.inf])
def test_a_root_outside_the_world_is_unknown(far: float) -> None:
    live = chosen()
    live.hear(pose(0.1), np.array([far, 0.0, 0.0], dtype=np.float32), 0.0, STILL[0])
    assert np.array_equal(live.lay_over(0.0, STILL, ROOTS)[1], ROOTS)


def test_a_fast_dancer_is_believed() -> None:
    live = chosen()
    for tick in range(100):
        root = np.array([0.2 * tick, 0.9, 0.0], dtype=np.float32)  # ten metres a second
        live.hear(pose(0.1), root, tick * TICK_S + 0.015 * (tick % 2), STILL[0])
        live.lay_over(tick * TICK_S, STILL, ROOTS)
    assert live.jumps == 0


def test_it_continues_from_a_state() -> None:
    rng = np.random.default_rng(1)
    first, second = chosen(0.5), Live(JOINTS, WINDOW)
    for tick in range(60):
        if tick == 30:
            restore(second, packed(first))
        heard = random_quaternions(rng, JOINTS).astype(np.float32)
        heard[1, :] = math.nan if tick % 9 > 5 or 28 < tick < 33 else heard[1]
        for live in (first, second)[: 1 + (tick >= 30)]:
            live.hear(heard, ROOTS[0] * tick, tick * TICK_S, STILL[0])
        one = [array.copy() for array in first.lay_over(tick * TICK_S, STILL, ROOTS)]
        if tick >= 30:
            other = second.lay_over(tick * TICK_S, STILL, ROOTS)
            assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("unknown", [range(40, 60), range(40)])
def test_a_root_that_is_known_again_goes_on_from_where_the_figure_stands(unknown: range) -> None:
    live, path = chosen(), []
    for tick in range(100):
        place = np.array([0.004 * min(tick, 40) - 700.0, 0.9, 0.0], dtype=np.float32)
        root = NOWHERE if tick in unknown else place
        live.hear(pose(0.1), root, tick * TICK_S - 0.01, STILL[0])  # between two ticks
        path.append(live.lay_over(tick * TICK_S, STILL, ROOTS)[1][0].copy())
    assert np.abs(np.diff(path, axis=0)).max() < 0.01
