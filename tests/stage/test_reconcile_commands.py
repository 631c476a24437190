"""What cues and commands change in the dance: phrases, hands and iterations, without a jump."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.box.clock import Slot
from appliance.box.orders import Order
from appliance.pose import quaternion
from appliance.show.show import load_show
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from tests.bundles import FIGURE, write_show
from tests.stage.declared import Commanded, enabled
from tests.stage.shows import BOX


@pytest.fixture
def tick(parts: StageParts) -> Tick:
    return Tick(parts, SensorFit(parts, SensorMemory(None, print), print), 1.0)


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
