"""SensorBinding: one sensor on a dancer, the joints that it holds, and how it is worn there."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field, replace
from typing import Any

from appliance.dancer.puppeteers import WornSensor
from appliance.sensor.heading_drift import HeadingDrift
from appliance.sensor.link import SensorReading
from appliance.sensor.neutral import Mounting, NeutralPose, Stillness, joint_from_reading
from appliance.sensor.state import restored_reading
from appliance.sensor.wire import IS_NDOF

FRESH_S = 0.5  # an older reading does not tell how the dancer stands


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

    def correct(self, degrees: float) -> None:
        """So much more of the heading is drift; too little to be seen."""
        heading = math.remainder(self.pose.heading + math.radians(degrees), math.tau)
        self.pose = replace(self.pose, heading=heading)
        self.joint.adjust(joint_from_reading(self.pose, self.mounting))


@dataclass(slots=True)
class SensorBinding:
    """One sensor on a dancer: its joints, its newest reading, the stillness that it needs yet (0: none).

    drift: of its heading; all its joints share it.
    """

    SNAPSHOT = ("hands", "drift", "stillness", "reading", "needs_still_s", "waits_until")
    TIMES = ("waits_until",)

    name: str
    hands: list[WornHand]
    drift: HeadingDrift
    stillness: Stillness = field(default_factory=Stillness)
    reading: SensorReading | None = None
    needs_still_s: float = 0.0
    waits_until: float = math.inf

    def settle(self) -> None:
        """A restored reading is one again; the joints' matrices are the hands' to restore."""
        self.reading = restored_reading(self.reading)

    def correct_heading(self, now: float) -> bool:
        """Let the heading follow what is known of its drift; whether the joints were turned.

        A heading that a magnetometer keeps does not drift: nothing is estimated then.
        """
        reading = self.reading
        if reading is None or reading.flags & IS_NDOF or now - reading.arrival > FRESH_S:
            return False
        hand = self.hands[0]
        is_worn = not self.needs_still_s and self.has_pose_of(reading.boot_nonce)
        pose, joint = hand.pose if is_worn else None, hand.joint.local.tolist()
        step = self.drift.look(reading.orientation, joint, pose, self.stillness.still_s, now)
        if step:
            for hand in self.hands:
                hand.correct(step)
        return step != 0.0

    def has_pose_of(self, boot_nonce: int) -> bool:
        """Whether all poses hold for the readings of that power-on."""
        return all(hand.pose.boot_nonce == boot_nonce for hand in self.hands)


def upright(name: str, hand: WornHand, axis: tuple[float, float, float]) -> str:
    """The sentence if the axis that should face the front was upright instead."""
    substitute = "arrow" if axis[0] else "lid"
    return (
        f"Sensor {name}: the axis that should face the front stood upright, so the front was told by its "
        f"{substitute}. {hand.joint.joint} may move to a wrong side. Wear it as `facing` of its hand says "
        "(the arrow to the front, unless the show says otherwise), and take the neutral pose again."
    )
