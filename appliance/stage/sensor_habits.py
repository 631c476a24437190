"""The habit of a worn joint, as the phrases of the show tell it: what heading drift is measured against."""

from __future__ import annotations

from appliance.box.clock import TICK_S
from appliance.dancer.puppeteers import WornSensor
from appliance.sensor.heading_habit import HeadingHabit, habit_in
from appliance.sensor.neutral import Mounting
from appliance.stage.stage_parts import StageParts


def habit_of(parts: StageParts, joint: WornSensor, mounting: Mounting) -> HeadingHabit:
    """From all phrases that the puppet of this joint may play."""
    motion = next(
        (one.motion for one in parts.puppets if any(hand is joint for hand in one.hands.puppeteers)),
        parts.led.motion,
    )
    phrases = ((motion.loop_of(name).poses, 1.0 / TICK_S) for name in motion.phrases)
    return habit_in(phrases, parts.skeleton, parts.skeleton.index(joint.joint), mounting.at_neutral)
