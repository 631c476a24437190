"""A dance that starts anew goes on where the last one was: in its phrase, at its rate, in every cue."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.box.clock import TICK_S
from appliance.box.orders import Order
from appliance.dancer.motion_source import Playback
from appliance.levers.show_state import ShowState
from appliance.levers.table import GOING, ITERATIONS, PHRASE, RATE
from appliance.pose import quaternion
from appliance.stage.carry_out import obey
from appliance.stage.reconcile import Reconciler
from appliance.stage.resume import Resumption
from tests.stage.places import declare
from tests.stage.shows import NOW


def window_of(motion: Playback) -> tuple[np.ndarray, np.ndarray]:
    return motion.window().copy(), motion.roots().copy()


def do(dance: Reconciler, *orders: Order) -> None:
    for order in orders:
        assert obey(order, dance.parts)[0]


def goes_on(dance: Reconciler, runtime: Path, again: Reconciler) -> str:
    """Note where a dance is, and resume another one there; gives what was said."""
    with closing(Resumption("A test", runtime, None, "always")) as noting:
        noting.write_checkpoint(dance, 7)
    with closing(Resumption("A test", runtime, None, "always")) as resuming:
        return resuming.go_on(again, NOW)


@pytest.mark.parametrize("ticks", [0, 1, 30, 149, 151, 400, 1234])
@pytest.mark.parametrize("rate", [1.0, 0.7, -1.0])
def test_the_very_next_pose_comes_next_at_its_place_on_the_stage(
    dance_of: Callable[[], Reconciler], runtime: Path, ticks: int, rate: float
) -> None:
    before, after = dance_of(), dance_of()
    do(before, Order("phrase", (0.5,), "walk"))
    before.rate = before.parts.led.motion.rate = rate
    for _ in range(200 + ticks):
        before.parts.led.motion.advance()
    message = goes_on(before, runtime, after)
    assert "After a restart of the stage" in message and "the phrase 'walk'" in message
    for _ in range(60):
        poses, roots = window_of(before.parts.led.motion)
        poses_after, roots_after = window_of(after.parts.led.motion)
        assert quaternion.angle_between(poses[0], poses_after[0]).max() < 0.01
        np.testing.assert_allclose(roots_after[0], roots[0], atol=0.005)
        was_at_s = before.parts.led.motion.position_s
        assert after.parts.led.motion.position_s == pytest.approx(was_at_s, abs=2e-3)
        before.parts.led.motion.advance()
        after.parts.led.motion.advance()


@pytest.mark.parametrize("ticks", [0, 1, 4, 8, 20])
def test_a_phrase_that_was_just_asked_for_is_the_one_that_comes_back(
    dance_of: Callable[[], Reconciler], runtime: Path, ticks: int
) -> None:
    """Also while it has not reached the window's first pose, or is still fading in."""
    before, after = dance_of(), dance_of()
    for _ in range(50):
        before.parts.led.motion.advance()
    do(before, Order("phrase", (1.0,), "walk"))
    for _ in range(ticks):
        before.parts.led.motion.advance()
    goes_on(before, runtime, after)
    assert after.parts.led.motion.phrase == "walk"
    assert after.parts.led.motion.position_s == pytest.approx(max(0.0, (ticks - 8) * TICK_S), abs=0.03)


def test_excerpt_rate_iterations_hands_and_cue_come_back(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    before, after = dance_of(), dance_of()
    do(before, Order("phrase", (0.2,), "walk"), Order("iterations", (6.0, 5.0, 0.2)), Order("rate", (0.5,)))
    do(before, Order("hand", (0.0,), "lShldr"))
    before.cue, before.rate, before.generation = "storm", 0.5, 77
    before.parts.led.motion.excerpt(1.0, 3.0)
    for _ in range(80):
        before.parts.led.motion.advance()
        before.parts.led.iterations.advance()
    assert "in the cue 'storm'" in goes_on(before, runtime, after)
    assert (after.cue, after.rate, after.generation) == ("storm", 0.5, 77)
    assert (after.parts.led.motion.rate, after.parts.led.motion.excerpt_s) == (0.5, (1.0, 3.0))
    assert (after.parts.led.iterations.coding, after.parts.led.iterations.interaction) == (6, 5)
    assert {one.joint: one.enabled for one in after.parts.led.hands.puppeteers} == {
        "lShldr": False,
        "Chest": True,
    }


@pytest.mark.parametrize(("generation", "is_applied"), [(0, False), (1, True)])
def test_what_was_declared_while_the_stage_was_away_follows_and_what_it_followed_is_not_applied_again(
    dance_of: Callable[[], Reconciler], runtime: Path, generation: int, is_applied: bool
) -> None:
    before, after = dance_of(), dance_of()
    declared = ShowState(show="A test").to(PHRASE, "walk", NOW, 0.5)
    declare(runtime, declared)
    for _ in range(10):
        do(before, *before.pending(NOW))
        before.parts.led.motion.advance()
    before.parts.led.motion.excerpt(1.0, 3.0)
    if is_applied:
        declare(runtime, declared.to(PHRASE, "walk", NOW, 0.5).to(ITERATIONS, (6, 5), NOW))
    goes_on(before, runtime, after)
    orders = [Order("phrase", (0.5,), "walk"), Order("iterations", (6.0, 5.0, 0.0))]
    assert after.pending(NOW) == (orders if is_applied else [])


@pytest.mark.parametrize("by", ["stop", "player"])
def test_a_show_that_stands_comes_back_standing(
    dance_of: Callable[[], Reconciler], runtime: Path, by: str
) -> None:
    before, after = dance_of(), dance_of()
    for tick in range(100):
        if tick == 50:
            goes = ShowState(show="A test")
            declare(runtime, goes.to(GOING, 0.0, NOW) if by == "stop" else goes.to(RATE, 0.0, NOW))
        do(before, *before.pending(NOW))
        before.parts.led.motion.advance()
    goes_on(before, runtime, after)
    assert after.parts.led.motion.rate == 0.0 and not after.pending(NOW)
    for _ in range(20):
        after.parts.led.motion.advance()
    assert after.parts.led.motion.position_s == pytest.approx(before.parts.led.motion.position_s, abs=2e-3)
    if by == "stop":
        declare(runtime, ShowState(show="A test"))
        assert after.pending(NOW) == [Order("rate", (1.0,))]


def test_what_grounding_moved_the_figure_by_comes_back(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    before, after = dance_of(), dance_of()
    before.parts.led.grounding.strayed = (0.2, -0.1)
    goes_on(before, runtime, after)
    assert after.parts.led.grounding.strayed == (0.2, -0.1)
