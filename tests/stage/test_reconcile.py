"""What show control declares: the dance follows between two ticks, and applies each part once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from appliance.box.orders import Order
from appliance.dancer.puppeteers import Remote
from appliance.levers.show_state import Change, ShowState
from appliance.levers.table import CUE, GOING, ITERATIONS, PHRASE, RATE, hand
from appliance.pose import quaternion
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.stage_parts import StageParts
from tests.bundles import FIGURE
from tests.stage.declared import Commanded, Declared, enabled, follow
from tests.stage.shows import NOW


def test_nothing_is_pending_before_anything_is_declared_and_of_another_show(
    reconciler: Reconciler, declared: Declared
) -> None:
    assert not reconciler.pending(NOW)
    declared.now = replace(declared.now.to(PHRASE, "slow", NOW), show="Another")
    assert not reconciler.pending(NOW) and reconciler.generation == 0


def test_of_what_several_commands_declared_meanwhile_the_newest_counts(
    reconciler: Reconciler, declared: Declared
) -> None:
    """After a stall, in the order in which they came."""
    changes: tuple[list[Change[Any]], ...] = (
        [Change(ITERATIONS, (5, 4)), Change(RATE, 3.0)],
        [Change(PHRASE, "slow", 1.0), Change(hand("Chest"), False)],
        [Change(RATE, 2.0)],
        [Change(ITERATIONS, (6, 5), 0.5)],
    )
    for one in changes:
        declared.now = declared.now.changed(NOW, one)
    assert list(reconciler.pending(NOW)) == [
        Order("phrase", (1.0,), "slow"),
        Order("hand", (0.0,), "Chest"),
        Order("iterations", (6.0, 5.0, 0.5)),
        Order("rate", (2.0,)),
    ]
    assert reconciler.generation == declared.now.generation


def test_a_part_is_applied_once_so_that_what_came_after_it_stays(
    parts: StageParts, reconciler: Reconciler, command: Commanded
) -> None:
    command("/hold", 1.0, text="Chest")
    chest = parts.led.hands.puppeteers[1]
    assert isinstance(chest, Remote)
    chest.release()
    command("/hold", 0.0, text="lShldr")
    assert chest._held is None  # an order gave it back since


def test_a_phrase_that_the_show_lost_changes_nothing_and_is_told(
    parts: StageParts, reconciler: Reconciler, declared: Declared
) -> None:
    declared.now = declared.now.to(PHRASE, "slwo", NOW).to(RATE, 0.5, NOW)
    assert "Did you mean 'slow'?" in follow(reconciler)
    parts.led.motion.advance()
    assert (parts.led.motion.rate, parts.led.motion.jumped) == (0.5, False)
    assert not reconciler.pending(NOW)


def test_a_stopped_show_stands_once_it_is_dark_and_goes_on_at_its_rate(
    parts: StageParts, reconciler: Reconciler, declared: Declared, command: Commanded
) -> None:
    def rate_at(now: float) -> float:
        follow(reconciler, now)
        return parts.led.motion.rate

    command("/player/rate", 0.5)
    declared.now = declared.now.to(GOING, 0.0, NOW, 2.0)
    assert [rate_at(NOW + t) for t in (0.0, 1.9, 2.0, 3.0)] == [0.5, 0.5, 0.0, 0.0]
    declared.now = declared.now.to(RATE, -1.0, NOW)  # in the dark it stands, and goes on so
    assert rate_at(NOW + 4.0) == 0.0
    declared.now = declared.now.to(GOING, 1.0, NOW + 5.0, 1.0)
    assert rate_at(NOW + 5.0) == -1.0
    declared.now = declared.now.to(RATE, None, NOW)
    assert rate_at(NOW + 6.0) == 1.0


def test_a_show_that_stands_by_itself_can_be_started(parts: StageParts) -> None:
    parts.led.motion.rate = 0.0
    declared = Declared()
    reconciler = Reconciler("A test", parts, declared)  # type: ignore[arg-type]
    assert not reconciler.pending(NOW)
    declared.now = declared.now.to(RATE, None, NOW)
    assert reconciler.pending(NOW) == [Order("rate", (1.0,))]


def test_a_stage_without_a_checkpoint_begins_with_what_is_declared(
    parts: StageParts, iterations: Iterations, reconciler: Reconciler, declared: Declared
) -> None:
    called = [Change(CUE, "storm"), Change(PHRASE, "slow", 2.0), Change(ITERATIONS, (12, 11), 2.0)]
    hands = [Change(hand("lShldr"), False), Change(hand("Chest"), True)]
    declared.now = declared.now.changed(NOW, [*called, *hands])
    sentence = reconciler.begin(NOW)
    assert "goes on in the cue 'storm'" in sentence and "at most 8 fit" in sentence
    assert (reconciler.cue, parts.led.motion.phrase, parts.led.motion.position_s) == ("storm", "slow", 0.0)
    assert (iterations.coding, iterations.interaction) == (8, 7)
    assert enabled(parts) == {"lShldr": False, "Chest": True}
    parts.led.motion.advance()
    assert not parts.led.motion.jumped
    first = parts.led.motion.window()[0][FIGURE.index("Chest")]
    held = parts.led.hands.puppeteers[1].pull(10.0).orientation
    assert quaternion.angle_between(held, first) < 0.1


@pytest.mark.parametrize(
    "show_state",
    [ShowState(), ShowState(show="Another").to(CUE, "storm", NOW).to(RATE, 0.5, NOW)],
)
def test_with_nothing_declared_for_this_show_it_begins_as_it_does(
    parts: StageParts,
    iterations: Iterations,
    reconciler: Reconciler,
    declared: Declared,
    show_state: ShowState,
) -> None:
    declared.now = show_state
    assert reconciler.begin(NOW) == ""
    motion = parts.led.motion
    assert (reconciler.cue, motion.phrase, motion.rate, iterations.coding) == ("", "main", 1.0, 3)
