"""SensorBinding: one sensor on a dancer, the joints that it holds, and how it is worn there."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field
from typing import Any

from appliance.dancer.puppeteers import WornSensor
from appliance.sensor.link import SensorReading
from appliance.sensor.neutral import Mounting, NeutralPose, Stillness, joint_from_reading
from appliance.sensor.state import restored_reading


@dataclass(slots=True)
class WornHand:
    """One joint that a sensor holds, and the neutral pose that is in force for it."""

    joint: WornSensor
    mounting: Mounting
    pose: NeutralPose = field(init=False)

    def wear(self, pose: NeutralPose) -> None:
        """From now on readings are turned by this pose."""
        self.pose = pose
        self.joint.wear(joint_from_reading(pose, self.mounting))

    def state(self) -> tuple[Any, ...]:
        """The pose as a plain value, for `restore`."""
        return astuple(self.pose)

    def restore(self, state: tuple[Any, ...]) -> None:
        """Be worn as the one was that gave this state."""
        self.pose = NeutralPose(*state)


@dataclass(slots=True)
class SensorBinding:
    """One sensor on a dancer: its joints, its newest reading, the stillness that it needs yet (0: none)."""

    SNAPSHOT = ("hands", "stillness", "reading", "needs_still_s", "waits_until")

    name: str
    hands: list[WornHand]
    stillness: Stillness = field(default_factory=Stillness)
    reading: SensorReading | None = None
    needs_still_s: float = 0.0
    waits_until: float = math.inf

    def settle(self) -> None:
        """A restored reading is one again; the joints' matrices are the hands' to restore."""
        self.reading = restored_reading(self.reading)

    def has_pose_of(self, boot_nonce: int) -> bool:
        """Whether all poses hold for the readings of that power-on."""
        return all(hand.pose.boot_nonce == boot_nonce for hand in self.hands)


def upright(name: str, hand: WornHand, axis: tuple[float, float, float]) -> str:
    """The sentence if the axis that should face the front was upright instead."""
    told_by = "arrow" if axis[0] else "lid"
    return (
        f"Sensor {name}: the axis that should face the front stood upright, so the front was told by its "
        f"{told_by}. {hand.joint.joint} may move to a wrong side. Wear it as `facing` of its hand says "
        "(the arrow to the front, unless the show says otherwise), and take the neutral pose again."
    )
