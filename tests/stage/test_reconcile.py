"""What show control declares: the dance follows between two ticks, and applies each part once."""

from __future__ import annotations

import gc
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.checkpoint import CheckpointReader
from appliance.box.clock import Slot
from appliance.box.orders import Order
from appliance.box.show_state import ShowStateWriter
from appliance.dancer.puppeteers import Remote
from appliance.levers.show_state import Change, ShowState
from appliance.levers.table import CUE, GOING, ITERATIONS, PHRASE, RATE, hand
from appliance.outputs.frame_reader import FrameReader
from appliance.pose import quaternion
from appliance.show.box import BoxConfig
from appliance.show.show import Show, load_show
from appliance.show_control.command import Command
from appliance.show_control.show_state_commands import declare
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.run import Stage
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from tests.bundles import FIGURE, write_show
from tests.logged import said
from tests.stage.declared import Commanded, Declared, enabled, follow
from tests.stage.shows import BOX, NOW


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
    chest.let_go()
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


@pytest.fixture
def tick(parts: StageParts) -> Tick:
    return Tick(parts, SensorFit(parts, SensorMemory(None)), 1.0)


def danced(tick: Tick, ticks: int, begin: int = 0) -> np.ndarray:
    """Poses (ticks, J, 4) of the frames from number `begin` on."""
    poses = []
    for number in range(begin, begin + ticks):
        slot = Slot(number, 10 + 0.02 * number, 10 + 0.02 * number, 0)
        tick.run(slot)
        poses.append(tick.frame.puppets[0].pose.copy())
        tick.after(slot)
    return np.array(poses)


def reached(iterations: Iterations) -> tuple[int, int]:
    """How often the puppet goes over a window once the change is over."""
    for _ in range(50 * 60):
        iterations.advance()
    return iterations.coding, iterations.interaction


def test_a_cue_changes_phrase_iterations_and_hands(
    parts: StageParts, iterations: Iterations, reconciler: Reconciler, command: Commanded
) -> None:
    assert "with 8 and 7: at most 8 fit" in command("/cue", text="storm")  # the cue asks for 12 and 11
    assert reached(iterations) == (8, 7)
    assert enabled(parts) == {"lShldr": False, "Chest": True}
    assert reconciler.cue == "storm"
    for _ in range(20):
        parts.led.motion.advance()
    assert parts.led.motion.phrase == "slow"
    assert command("/cue", text="start") == ""
    assert reached(iterations) == (4, 3)
    assert enabled(parts) == {"lShldr": True, "Chest": True}


def test_what_a_cue_leaves_out_stays(
    parts: StageParts, iterations: Iterations, reconciler: Reconciler, command: Commanded
) -> None:
    command("/cue", text="storm")
    command("/cue", text="lights only")
    assert reached(iterations) == (8, 7)
    assert enabled(parts) == {"lShldr": False, "Chest": True}
    assert reconciler.cue == "lights only"
    command("/cue", text="alone")
    assert enabled(parts) == {"lShldr": False, "Chest": False}


def test_a_cue_shows_no_jump(command: Commanded, tick: Tick) -> None:
    parts = [danced(tick, 70)]
    for place, name in enumerate(("storm", "start", "alone", "storm")):
        command("/cue", text=name)
        parts.append(danced(tick, 70, 70 * (place + 1)))
    poses = np.concatenate(parts)
    from_tick_to_tick = np.sum(poses[1:] * poses[:-1], axis=-1).min(axis=-1)
    before_the_first_cue = from_tick_to_tick[:69].min()
    assert from_tick_to_tick.min() > 0.99 * before_the_first_cue > 0.8
    still = FIGURE.index("lForeArm")
    assert quaternion.angle_between(poses[1:, still], poses[:-1, still]).max() < 1e-3


def test_a_phrase_is_called_with_its_own_fade(parts: StageParts, command: Commanded) -> None:
    assert command("/phrase", 1.0, text="slow") == ""
    parts.led.motion.advance()
    assert parts.led.motion.jumped
    assert "plays already" in command("/phrase", 1.0, text="slow")
    assert command("/phrase", text="main") == ""


def test_a_phrase_that_is_called_again_plays_as_a_whole(parts: StageParts, command: Commanded) -> None:
    command("/phrase", text="slow")
    parts.led.motion.excerpt(1.0, 2.0)
    assert command("/phrase", text="slow") == ""
    assert parts.led.motion.excerpt_s == pytest.approx((0.0, 5.0), abs=0.1)


def test_a_hand_lets_go_and_holds(parts: StageParts, command: Commanded, tick: Tick) -> None:
    place = parts.led.hand_places[0]
    danced(tick, 50)
    assert parts.led.hands.weights[place] == 1.0
    command("/hold", 0.0, text="lShldr")
    danced(tick, 60, 50)
    assert parts.led.hands.weights[place] == 0.0
    command("/hold", 1.0, text="lShldr")
    danced(tick, 60, 110)
    assert parts.led.hands.weights[place] == 1.0


def test_a_hand_by_osc_that_was_told_nothing_holds_its_joint_where_it_is(
    parts: StageParts, command: Commanded, tick: Tick
) -> None:
    chest = FIGURE.index("Chest")
    before = danced(tick, 62)
    assert quaternion.angle_between(before[-1, chest], before[-20, chest]) > 0.1  # it sways
    command("/hold", 1.0, text="Chest")
    held = parts.led.hands.puppeteers[1].pull(11.24).orientation.copy()
    assert quaternion.angle_between(held, before[-1, chest]) < 1e-3
    after = danced(tick, 100, 62)
    assert quaternion.angle_between(after[-50:, chest], held).max() < 1e-3


def test_a_kept_joint_holds_and_lets_go(tmp_path: Path) -> None:
    parts = assemble(load_show(write_show(tmp_path / "kept", [{"kept": True, "joint": "Chest"}])), BOX)
    place = parts.led.hand_places[0]
    for holds, begins in ((True, 0), (False, 60), (True, 120)):
        obey(Order("hand", (float(holds),), "Chest"), parts)
        for tick in range(60):
            window = parts.led.puppet.select(parts.led.motion.window())
            parts.led.hands.pull(10.0 + 0.02 * (begins + tick), window)
            assert np.array_equal(parts.led.hands.targets[:, place], window[:, place])
            parts.led.motion.advance()
        assert parts.led.hands.weights[place] == float(holds)
    parts.close()


def test_iterations_that_leave_the_hands_idle_are_told(parts: StageParts, command: Commanded) -> None:
    idle = "None of the iterations is interactive: the hands move nothing."
    assert command("/iterations", 1.0, 0.0) == idle
    command("/cue", text="alone")
    assert command("/iterations", 1.0, 0.0) == ""


def test_springs_follow_what_is_declared_also_after_a_restart(tmp_path: Path, declared: Declared) -> None:
    cues = [{"name": "gale", "springs": "storm", "fade_s": 0}]
    show = load_show(write_show(tmp_path / "sprung", [{"springs": "stiff", "joint": "Hips"}], cues=cues))
    parts, again = assemble(show, BOX), assemble(show, BOX)
    facts = facts_of(show, None, Iterations(3, 2, most=8), NOW)
    reconciler = Reconciler("A test", parts, declared)  # type: ignore[arg-type]
    assert parts.led.springs is not None and again.led.springs is not None

    def say(address: str, *values: float, text: str = "") -> None:
        declared.now, _ = declare(declared.now, Command(address, values, text), facts, NOW)
        follow(reconciler)

    say("/springs/wind", 1.0, 2.0, 3.0)
    say("/cue", text="gale")
    assert parts.led.springs.setting == "storm"
    assert parts.led.springs.wind.tolist() == list(
        parts.led.springs.settings["storm"].wind
    )  # the older wind is over
    say("/springs", text="loose")
    say("/springs/wind", 3.0, 0.0, -1.0)
    say("/springs/gravity", 5.0)
    restarted = Reconciler("A test", again, declared)  # type: ignore[arg-type]
    restarted.generation = reconciler.generation  # as its checkpoint says
    follow(restarted)
    assert not restarted.pending(NOW)
    for springs in (parts.led.springs, again.led.springs):
        assert (springs.setting, springs.gravity, springs.wind.tolist()) == ("loose", 5.0, [3.0, 0.0, -1.0])
    with pytest.raises(ValueError, match="Did you mean 'loose'"):
        say("/springs", text="lose")
    parts.close()
    again.close()


@pytest.mark.parametrize("puppets", [1, 2])
def test_strings_drive_no_joint_in_panic_blackout_and_after_a_stop(
    tmp_path: Path, declared: Declared, puppets: int
) -> None:
    strung = [{"springs": "stiff", "joint": "Hips"}]
    settings, two = [{"name": "stiff", "feedback": 1}], [{"name": "left"}, {"name": "right", "hands": strung}]
    first = strung if puppets == 1 else []
    config = {"springs": settings, **({"puppets": two} if puppets == 2 else {})}
    parts = assemble(load_show(write_show(tmp_path / "strung", first, **config)), BOX)
    reconciler = Reconciler("A test", parts, declared)  # type: ignore[arg-type]
    (springs,) = parts.springs
    assert springs.feedback == 1.0
    for away, back in (("/panic", "/go"), ("/stop", "/go"), ("/blackout", "/blackout")):
        for address, values in ((away, (1.0,)), (back, () if back == "/go" else (0.0,))):
            declared.now, _ = declare(declared.now, Command(address, values), None, NOW)
            follow(reconciler)
            assert springs.feedback == 0.0
        gains = []
        for tick in range(60):
            springs.pull(NOW + 0.02 * tick)
            gains.append(springs.feedback)
        assert gains[-1] == 1.0 and max(np.diff(gains)) < 0.05  # and comes back evenly
    parts.close()


def test_springs_of_which_there_are_none_are_refused(command: Commanded, parts: StageParts) -> None:
    with pytest.raises(ValueError, match="No hand of this show is springs"):
        command("/springs/wind", 1.0, 0.0, 0.0)
    done, message = obey(Order("kick", (1.0, 0.0, 0.0)), parts)
    assert not done and "No hand of this show is springs" in message


def test_the_stage_begins_with_the_show_state_of_its_folder(show: Show, box: BoxConfig) -> None:
    for cue, phrase in (("storm", "slow"), ("", "main")):
        with closing(ShowStateWriter(box.runtime)) as writer:
            declared = ShowState(show="A test")
            writer.write(declared.to(CUE, cue, NOW).to(PHRASE, phrase, NOW) if cue else declared)
        said.clear()
        stage = Stage(show, box)
        with closing(stage):
            stage.dance(0.1, lambda: False)
            assert (stage.reconciler.cue, stage.parts.led.motion.phrase) == (cue, phrase)
        assert any("goes on in the cue 'storm'" in message for message in said) == (cue == "storm")


def test_the_dance_follows_within_a_tick_reports_it_and_notes_it_before(show: Show, box: BoxConfig) -> None:
    with (
        closing(ShowStateWriter(box.runtime)) as writer,
        closing(Stage(show, box)) as stage,
        closing(CheckpointReader(box.runtime)) as checkpoint,
        closing(FrameReader(box.runtime)) as frames,
    ):
        declared = ShowState(show="A test").to(CUE, "storm", NOW).to(PHRASE, "slow", NOW, 1.0)
        ticks: list[int] = []

        def follows() -> bool:
            """The stage asks this before each tick."""
            ticks.append(stage.health.ticks)
            if len(ticks) == 2:
                writer.write(declared)
            return len(ticks) == 4

        stage.dance(None, follows)
        frames.state(time.monotonic())
        health, place = frames.health(), checkpoint.read()
        assert health is not None and place is not None
        assert health["applied"] == [declared.generation, ""]
        assert health["cue"] == place.cue == "storm"
        assert (place.puppets[0].phrase, place.applied) == ("slow", declared.generation)
        reads = [stage.reconciler.pending(time.monotonic()) for _ in range(100)]
        assert reads == [[]] * 100


def test_an_unchanged_show_state_leaves_nothing_to_the_collector(show: Show, box: BoxConfig) -> None:
    with closing(ShowStateWriter(box.runtime)) as writer, closing(Stage(show, box)) as stage:
        writer.write(ShowState(show="A test").to(RATE, 1.0, NOW))
        stage.reconciler.pending(NOW)
        gc.collect()
        gc.disable()
        before = gc.get_count()[0]
        for _ in range(100):
            stage.reconciler.pending(NOW)
        grown = gc.get_count()[0] - before
        gc.enable()
    assert grown < 20
