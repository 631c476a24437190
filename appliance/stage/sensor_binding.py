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


@dataclass(slots=True)
class SensorBinding:
    """One sensor on a dancer: its joints, its newest reading, the stillness that it needs yet (0: none)."""

    name: str
    hands: list[WornHand]
    stillness: Stillness = field(default_factory=Stillness)
    reading: SensorReading | None = None
    needs_still_s: float = 0.0
    waits_until: float = math.inf

    def state(self) -> dict[str, Any]:
        """For `restore`: plain values."""
        return {
            "poses": [astuple(hand.pose) for hand in self.hands],
            "stillness": self.stillness.state(),
            "reading": self.reading,
            "needs_still_s": self.needs_still_s,
            "waits_until": self.waits_until,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on as the one did that gave this state; the joints' matrices are the hands' to restore."""
        for hand, ((w, x, y, z), heading, boot_nonce) in zip(self.hands, state["poses"], strict=True):
            hand.pose = NeutralPose((w, x, y, z), heading, boot_nonce)
        self.stillness.restore(state["stillness"])
        self.reading = restored_reading(state["reading"])
        self.needs_still_s, self.waits_until = state["needs_still_s"], state["waits_until"]

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
