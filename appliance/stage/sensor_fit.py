"""How the sensors are worn tonight: neutral poses taken in stillness, headings carried over, lamps lit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass, field, replace
from typing import Any

from appliance.box.clock import TICK_S
from appliance.dancer.puppeteers import WornSensor
from appliance.sensor.heading_drift import HeadingDrift
from appliance.sensor.heading_habit import HeadingHabit, habit_in
from appliance.sensor.link import SensorReading
from appliance.sensor.neutral import (
    NO_BOOT,
    STILL_S,
    Mounting,
    NeutralPose,
    Stillness,
    carried,
    front,
    joint_from_reading,
    with_heading_reset,
)
from appliance.sensor.state import restored_reading
from appliance.sensor.wire import IS_NDOF
from appliance.show.config_error import did_you_mean
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts

FRESH_S = 0.5  # an older reading does not tell how the dancer stands

ASKED_STILL_S = 0.5  # seconds of stillness are enough for a neutral pose that was asked for
ASKED_WITHIN_S = 3.0
CARRIED_WITHIN_S = 60.0  # a sensor that comes back later may have changed hands
_KEPT_DEGREES = 1.0  # a heading that was corrected by more is remembered


class SensorFit:
    """Joins what the sensors say with what the joints get; `messages` are those of the newest `look`.

    One neutral pose is taken by itself at each power-on, when the dancer stands still; after that only when
    asked for. A wearable that is back within a minute, or whose IMU restarted, keeps the pose: its heading is
    lost, and carried over from where the joint was. Another wearable under the same name does not.
    While the dancer dances, drift of the heading is estimated and taken out, slowly (HeadingDrift).
    """

    SNAPSHOT = ("_wearers", "_news", "corrects_heading")

    def __init__(
        self,
        parts: StageParts,
        memory: SensorMemory,
        corrects_heading: bool = True,
    ) -> None:
        self._link = parts.link
        self._memory = memory
        self._news: list[str] = []
        self.messages: tuple[str, ...] = ()
        self.corrects_heading = corrects_heading
        self._wearers = {name: _binding(parts, name) for name in parts.worn}
        for wearer in self._wearers.values():
            for hand in wearer.hands:
                saved = memory.neutral(wearer.name, hand.joint.joint)
                hand.wear(saved or hand.mounting.assumed_pose)

    def hear(self, reading: SensorReading) -> None:
        """Take a reading before its joints do; it takes part in the tick, so it says nothing."""
        wearer = self._wearers.get(reading.sensor)
        if wearer is None:
            return
        before, wearer.reading = wearer.reading, reading
        if before is None:
            self._meet(wearer, reading)
        elif reading.wearable != before.wearable:  # another wearable: it is mounted differently
            wearer.stillness.restart()
            wearer.drift.restart()
            self._ask_for_stillness(wearer)
        elif reading.boot_nonce != before.boot_nonce or reading.recoveries != before.recoveries:
            self._meet_again(wearer, before, reading)
        elif reading.taps != before.taps:
            wearer.stillness.restart()
            self._wait_for(wearer, ASKED_STILL_S, reading.arrival + ASKED_WITHIN_S)
        wearer.stillness.add_reading(reading.orientation, reading.arrival)

    def look(self, now: float) -> None:
        """After the frame: take the neutral pose of each sensor that is at rest, and report it; correct the
        headings of the others.
        """
        for wearer in self._wearers.values():
            if self.corrects_heading and wearer.correct_heading(now):
                self._keep_corrected(wearer)
            if wearer.needs_still_s and wearer.stillness.still_s >= wearer.needs_still_s:
                self._take(wearer)
            elif now > wearer.waits_until:
                self._give_up(wearer)
        self.messages = tuple(self._news)
        self._news.clear()

    def named(self, sensor: str | None) -> list[str]:
        """The sensors that a person means: one that the show knows, or all (None). Raises ValueError."""
        worn = list(self._wearers)
        if not worn:
            raise ValueError("No hand of this show is held by a sensor.")
        if sensor is not None and sensor not in worn:
            cure = did_you_mean(sensor, worn)
            raise ValueError(f"No hand of this show is held by a sensor '{sensor}'. {cure}")
        return worn if sensor is None else [sensor]

    def take_neutral(self, sensor: str | None, now: float) -> bool:
        """Asked for by a person: take the neutral pose of a sensor (all: None) at the next stillness.

        Whether anybody was asked; as `named` raises.
        """
        asked = self._asked(sensor, now)
        for wearer, _ in asked:
            self._wait_for(wearer, ASKED_STILL_S, now + ASKED_WITHIN_S)
        return bool(asked)

    def reset_heading(self, sensor: str | None, now: float) -> bool:
        """Asked for by a person: the dancer (all: None) faces the front as in the neutral pose, right now.

        Whether anybody was asked; as `named` raises.
        """
        asked = self._asked(sensor, now)
        for wearer, reading in asked:
            poses = [with_heading_reset(hand.pose, reading.orientation) for hand in wearer.hands]
            if any(pose is None for pose in poses):
                self._news.append(
                    f"Sensor {wearer.name} is upside down against its neutral pose: no heading can be told. "
                    "Its joint goes on as before. Stand as in the neutral pose, then ask again."
                )
                continue
            self._wear(wearer, [pose for pose in poses if pose is not None])
            wearer.drift.take_front()
            self._news.append(f"Sensor {wearer.name}: this is the front now. Dance.")
        return bool(asked)

    def neutral_of(self, sensor: str) -> str:
        """'taken' (since its power-on), 'wanted', 'kept' (from before), 'assumed', or '' for a stranger."""
        wearer = self._wearers.get(sensor)
        if wearer is None:
            return ""
        if wearer.needs_still_s:
            return "wanted"
        if wearer.reading is not None and wearer.has_pose_of(wearer.reading.boot_nonce):
            return "taken"
        return "assumed" if any(hand.pose.boot_nonce == NO_BOOT for hand in wearer.hands) else "kept"

    def corrected_of(self, sensor: str) -> float:
        """Degrees of drift that were taken out of a sensor's heading since it was set; 0 for a stranger."""
        wearer = self._wearers.get(sensor)
        return 0.0 if wearer is None else wearer.drift.corrected

    def settle(self) -> None:
        """The link knows which restored sensors wait for their neutral pose."""
        for name, wearer in self._wearers.items():
            if wearer.needs_still_s:
                self._link.wants_neutral.add(name)
            else:
                self._link.wants_neutral.discard(name)

    def _meet(self, wearer: SensorBinding, reading: SensorReading) -> None:
        """The first reading of this run: after a restart of only the box, its pose holds still."""
        wearer.drift.take_front()
        if wearer.has_pose_of(reading.boot_nonce):
            self._news.append(f"Sensor {wearer.name}: the neutral pose taken before is used on. Dance.")
        else:
            self._ask_for_stillness(wearer)

    def _meet_again(self, wearer: SensorBinding, before: SensorReading, reading: SensorReading) -> None:
        """The sensor was switched on again, or its IMU restarted: its heading is another one."""
        wearer.stillness.restart()
        wearer.drift.restart()
        wearer.drift.take_front()
        is_known = wearer.has_pose_of(before.boot_nonce)
        if not is_known or reading.arrival - before.arrival > CARRIED_WITHIN_S:
            self._ask_for_stillness(wearer)
            return
        poses = (
            carried(hand.pose, before.orientation, reading.orientation, reading.boot_nonce)
            for hand in wearer.hands
        )
        self._wear(wearer, poses)
        what = "'s IMU restarted" if reading.boot_nonce == before.boot_nonce else " is on again"
        self._news.append(
            f"Sensor {wearer.name}{what}: its joint goes on where it was. "
            "If it stands askew: a double tap on the sensor, then stand still."
        )

    def _ask_for_stillness(self, wearer: SensorBinding) -> None:
        self._wait_for(wearer, STILL_S)
        self._news.append(f"Sensor {wearer.name} is on. Its dancer stands still for a breath now.")

    def _take(self, wearer: SensorBinding) -> None:
        reading = wearer.reading
        assert reading is not None
        self._stop_waiting(wearer)
        pose = NeutralPose(reading.orientation, 0.0, reading.boot_nonce)
        self._wear(wearer, [pose] * len(wearer.hands))
        wearer.drift.take_neutral()
        self._news.append(f"Sensor {wearer.name}: neutral pose taken. Dance.")
        for hand in wearer.hands:
            _, axis = front(pose.orientation, hand.mounting.facing)
            if axis != hand.mounting.facing:
                self._news.append(upright(wearer.name, hand, axis))

    def _give_up(self, wearer: SensorBinding) -> None:
        """The dancer asked for a neutral pose and moved. A power-on without its first pose still waits."""
        self._news.append(
            f"Sensor {wearer.name} did not keep still within {ASKED_WITHIN_S:g} s: no new neutral pose. "
            "Its joint goes on as before. Ask again, and stand still at once."
        )
        if wearer.reading is not None and wearer.has_pose_of(wearer.reading.boot_nonce):
            self._stop_waiting(wearer)
        else:
            self._wait_for(wearer, STILL_S)

    def _wait_for(self, wearer: SensorBinding, still_s: float, until: float = math.inf) -> None:
        wearer.needs_still_s, wearer.waits_until = still_s, until
        self._link.wants_neutral.add(wearer.name)

    def _stop_waiting(self, wearer: SensorBinding) -> None:
        wearer.needs_still_s, wearer.waits_until = 0.0, math.inf
        self._link.wants_neutral.discard(wearer.name)

    def _wear(self, wearer: SensorBinding, poses: Iterable[NeutralPose]) -> None:
        """Put a pose on each of the sensor's joints, and keep them for the next start, all or none."""
        taken: dict[str, NeutralPose] = {}
        for hand, pose in zip(wearer.hands, poses, strict=True):
            hand.wear(pose)
            if pose.boot_nonce != NO_BOOT:
                taken[hand.joint.joint] = pose
        if taken:
            self._memory.keep_neutral(wearer.name, taken)

    def _keep_corrected(self, wearer: SensorBinding) -> None:
        """Keep a corrected heading for the next start, once it has moved far enough."""
        saved = self._memory.neutral(wearer.name, wearer.hands[0].joint.joint)
        off = wearer.hands[0].pose.heading - (saved.heading if saved is not None else 0.0)
        if abs(math.remainder(off, math.tau)) > math.radians(_KEPT_DEGREES):
            self._memory.keep_neutral(wearer.name, {hand.joint.joint: hand.pose for hand in wearer.hands})

    def _asked(self, sensor: str | None, now: float) -> list[tuple[SensorBinding, SensorReading]]:
        """The sensors that a command means and that have a fresh reading; silent ones have no pose."""
        wearers = (self._wearers[name] for name in self.named(sensor))
        return [
            (wearer, wearer.reading)
            for wearer in wearers
            if wearer.reading is not None and now - wearer.reading.arrival <= FRESH_S
        ]


def _binding(parts: StageParts, name: str) -> SensorBinding:
    """A sensor of the show and its joints; the first one tells of drift."""
    joints, mountings = parts.worn[name], parts.mountings[name]
    drift = HeadingDrift(habit_of(parts, joints[0], mountings[0]), mountings[0].at_neutral)
    return SensorBinding(name, list(map(WornHand, joints, mountings)), drift)


def habit_of(parts: StageParts, joint: WornSensor, mounting: Mounting) -> HeadingHabit:
    """From all phrases that the puppet of this joint may play."""
    motion = next(
        (one.motion for one in parts.puppets if any(hand is joint for hand in one.hands.puppeteers)),
        parts.led.motion,
    )
    phrases = ((motion.loop_of(name).poses, 1.0 / TICK_S) for name in motion.phrases)
    return habit_in(phrases, parts.skeleton, parts.skeleton.index(joint.joint), mounting.at_neutral)


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
