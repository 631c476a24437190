"""Puppeteers: each holds one joint (worn sensor, turning axis, fixed orientation, phrase, OSC)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.slerp import FloatArray
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.turns import Vector, about, axis_angle, inverse, multiplied

HOLD_S = 0.1  # seconds of silence after which a sensor's joint is released
GIVE_BACK_S = 1.0
TAKE_S = 0.5
AHEAD_S = 0.01  # how far a reading is turned on, by its angular velocity; further it would overshoot
PAIR_S = 0.001, 0.05  # two readings this far apart tell an angular velocity
_STILL: tuple[Vector, float] = (1.0, 0.0, 0.0), 0.0  # an axis, and radians, or radians a second, about it
LONGEST_STEP_S = 0.12  # six ticks; after a longer stall the targets continue from their last state


@dataclass(slots=True)
class Target:
    """One joint, one orientation ((4,) unit, local to the parent), one weight 0..1; reused at each tick."""

    SNAPSHOT = ("orientation", "weight")

    joint: str
    orientation: FloatArray
    weight: float = 0.0


class Puppeteer:
    """Holds one joint. Its weight eases in over TAKE_S when it takes the joint and eases out over GIVE_BACK_S
    when it releases it; a new `weight` is approached at the pace of taking. A disabled puppeteer releases the
    joint, whatever its source, and takes it again when enabled.

    Where it knows the phrase's orientation (start_from), its target is led from there when it takes the joint
    and back there when it releases it, and the weight fades in the part of that in which the two are near.
    Without that, the joint would turn over in one tick where hand and phrase pass opposite orientations,
    because the network mixes the two by the short way.
    """

    SNAPSHOT: tuple[str, ...] = (
        *("weight", "enabled", "_target", "_presence", "_level", "_pulled_at"),
        *("_holding", "_lead_over_s", "_leading_s", "_led_s", "_apart"),
    )
    TIMES: tuple[str, ...] = ("_pulled_at",)
    GRIP = 3.0  # the weight is whole after this part of a fade in which the target is led

    def __init__(self, joint: str, weight: float = 1.0) -> None:
        self.joint = joint
        self.weight = weight
        self.enabled = True
        self._target = Target(joint, quaternion.IDENTITY.copy())
        self._presence = 0.0
        self._level = weight
        self._pulled_at: float | None = None
        self._phrases_own: FloatArray | None = None
        self._holding = False
        self._lead_over_s = 0.0  # how long the next pull begins to lead the target
        self._leading_s = self._led_s = 0.0  # rest and total of the time in which it is led
        self._apart = _STILL  # the turn from the target to where it is led from: axis, and radians

    @property
    def is_holding(self) -> bool:
        """Whether the last pull gave the joint any weight."""
        return self._target.weight > 0.0

    @property
    def held_weight(self) -> float:
        """How much weight the last pull gave the joint, 0..1."""
        return self._target.weight

    @property
    def orientation(self) -> FloatArray:
        """Where the last pull pointed the joint, (4,) local; overwritten by the next."""
        return self._target.orientation

    def start_from(self, orientation: FloatArray) -> None:
        """Before each pull: the phrase's orientation of the joint, (4,) local; read in the pull."""
        self._phrases_own = orientation

    def pull(self, now: float) -> Target:
        """The target at the time `now`; it stands still while the time does.

        One pull advances it by LONGEST_STEP_S at most: in a longer gap between two pulls it stood still.
        """
        elapsed = 0.0 if self._pulled_at is None else min(max(0.0, now - self._pulled_at), LONGEST_STEP_S)
        self._pulled_at = now
        orientation, holds = self._target.orientation, self.enabled and self._holds(now)
        before = orientation.tolist()
        self._point(orientation, now, elapsed)
        grip = 1.0
        if (phrases_own := self._phrases_own) is not None:
            grip = self.GRIP
            if self._presence == 0.0:  # the first tick of all, too
                before = phrases_own.tolist()
            if holds != self._holding:
                rest_s = TAKE_S * (1.0 - self._presence) if holds else GIVE_BACK_S * self._presence
                self._lead_over_s = max(self._lead_over_s, rest_s)
            if not holds:
                orientation[:] = phrases_own
        self._holding = holds
        self._lead(orientation, before, elapsed)
        if holds:
            self._presence = min(1.0, self._presence + elapsed / TAKE_S)
        else:
            self._presence = max(0.0, self._presence - elapsed / GIVE_BACK_S)
        most = elapsed / TAKE_S
        self._level += min(max(self.weight - self._level, -most), most)
        self._target.weight = self._level * ease(min(1.0, grip * self._presence))
        return self._target

    def _lead(self, orientation: FloatArray, before: Sequence[float], elapsed: float) -> None:
        """Lead the target to its new orientation from that of the tick before, by half a turn in TAKE_S at
        most, where something has asked for it.

        The difference is fixed then and removed by and by. Recomputed each tick it made steps of 25 degrees
        for a hand that moved by 7, and reversed where the hand passed the opposite orientation.
        """
        if not (self._lead_over_s or self._leading_s):
            return
        present = _four(orientation.tolist())
        if self._lead_over_s:
            self._apart = axis, angle = axis_angle(multiplied(_four(before), inverse(present)))
            self._leading_s = self._led_s = max(self._lead_over_s, TAKE_S * angle / math.pi)
            self._lead_over_s = 0.0
        self._leading_s = max(0.0, self._leading_s - elapsed)
        axis, angle = self._apart
        orientation[:] = multiplied(about(axis, angle * ease(self._leading_s / self._led_s)), present)

    def _holds(self, now: float) -> bool:
        """Whether the joint should be held at the time `now`."""
        return True

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        """Write the orientation (4,) at the time `now`, `elapsed` seconds after the last pull."""


class WornSensor(Puppeteer):
    """A sensor that a dancer wears. After 100 ms of silence its joint is released over 1 s. When readings
    return, the joint is taken over 0.5 s, and the target is led to them over the length of the silence (0.5 s
    at most): the difference at its end is removed evenly while the readings continue.

    A reading with a time of measurement is turned on to the time of the pull by the angular velocity of the
    last two, for AHEAD_S at most.

    joint_from_reading: the matrix (4, 4) from a reading (w, x, y, z; sensor axes) to the joint's local
    orientation; it preserves length. None: the readings are local orientations already.
    """

    SNAPSHOT = (
        "_joint_from_reading",
        "_reading",
        "_local",
        "_heard_at",
        "_measured_at",
        "_turn",
    )
    TIMES = ("_heard_at", "_measured_at")

    def __init__(
        self, joint: str, weight: float = 1.0, joint_from_reading: NDArray[np.float32] | None = None
    ) -> None:
        super().__init__(joint, weight)
        self._joint_from_reading = (
            np.eye(4, dtype=np.float32) if joint_from_reading is None else joint_from_reading
        )
        self._reading, self._local = quaternion.IDENTITY.copy(), quaternion.IDENTITY.copy()
        self._heard_at: float | None = None
        self._measured_at: float | None = None
        self._turn = _STILL

    def wear(self, joint_from_reading: NDArray[np.float32]) -> None:
        """Use the matrix of a new neutral pose; the target is led over, as after a silence."""
        self._joint_from_reading, self._measured_at = joint_from_reading, None
        if self._heard_at is not None:
            np.matmul(joint_from_reading, self._reading, out=self._local)
            self._lead_over_s = TAKE_S

    def adjust(self, joint_from_reading: NDArray[np.float32]) -> None:
        """Use a matrix that differs by less than can be seen: the target is not led."""
        self._joint_from_reading, self._measured_at = joint_from_reading, None

    @property
    def local(self) -> FloatArray:
        """The joint's orientation by the newest reading, (4,); overwritten by the next."""
        return self._local

    def take_reading(
        self,
        orientation: Sequence[float] | FloatArray,
        arrival: float,
        measured_at: float | None = None,
    ) -> None:
        """Take a reading (unit quaternion w, x, y, z) that arrived at this time. measured_at: on the same
        clock; None: unknown.
        """
        before = self._local.tolist()
        self._reading[:] = orientation
        np.matmul(self._joint_from_reading, self._reading, out=self._local)
        self._turn = self._turned_since(before, measured_at)
        self._measured_at = measured_at
        if self._heard_at is not None and arrival - self._heard_at > HOLD_S:
            self._lead_over_s = max(self._leading_s, min(arrival - self._heard_at, TAKE_S))
        self._heard_at = arrival

    def silent_s(self, now: float) -> float:
        """Seconds since the last reading; infinite before the first one."""
        return math.inf if self._heard_at is None else max(0.0, now - self._heard_at)

    def _holds(self, now: float) -> bool:
        return self.silent_s(now) <= HOLD_S

    def _turned_since(self, before: Sequence[float], measured_at: float | None) -> tuple[Vector, float]:
        """The angular velocity from the reading before to the newest one; none where a time is unknown."""
        if measured_at is None or self._measured_at is None:
            return _STILL
        between_s = measured_at - self._measured_at
        if not PAIR_S[0] <= between_s <= PAIR_S[1]:
            return _STILL
        axis, angle = axis_angle(multiplied(_four(self._local.tolist()), inverse(_four(before))))
        return axis, angle / between_s

    def _turned_on(self, now: float) -> Sequence[float]:
        """The newest reading, turned on to the time `now`."""
        axis, rate = self._turn
        local: list[float] = self._local.tolist()
        if self._measured_at is None or rate == 0.0:
            return local
        return multiplied(about(axis, rate * min(max(now - self._measured_at, 0.0), AHEAD_S)), _four(local))

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        orientation[:] = self._turned_on(now)


class TurningAxis(Puppeteer):
    """Turns its joint about an axis at a constant rate."""

    SNAPSHOT = ("_half_angle",)

    def __init__(
        self,
        joint: str,
        axis: Sequence[float],
        seconds_per_turn: float,
        weight: float = 1.0,
        turned: float = 0.0,
    ) -> None:
        """turned: radians, at the first pull.

        Raises ValueError for an axis of no length or a turn that takes no time.
        """
        super().__init__(joint, weight)
        length = math.hypot(*axis)
        if len(axis) != 3 or not 0 < length < math.inf:
            raise ValueError(f"The axis {list(axis)} has no direction. Name one, for example [0, 1, 0].")
        if not seconds_per_turn:
            raise ValueError("A turn cannot take 0 seconds. A negative number turns the other way.")
        self._x, self._y, self._z = (value / length for value in axis)
        self.seconds_per_turn = seconds_per_turn
        self._half_angle = turned / 2

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        self._half_angle = math.fmod(self._half_angle + math.pi * elapsed / self.seconds_per_turn, math.tau)
        sine = math.sin(self._half_angle)
        orientation[:] = math.cos(self._half_angle), sine * self._x, sine * self._y, sine * self._z


class FixedOrientation(Puppeteer):
    """Holds its joint still."""

    def __init__(self, joint: str, orientation: Sequence[float], weight: float = 1.0) -> None:
        super().__init__(joint, weight)
        self._orientation = _unit(orientation)

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        orientation[:] = self._orientation


class Kept(Puppeteer):
    """Keeps its joint at the phrase's own orientation, pose by pose (the paper's Figure 4).

    Its target is that of the window's first pose; Hands gives the other poses theirs.
    """

    GRIP = 1.0

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        if self._phrases_own is not None:
            orientation[:] = self._phrases_own


class Remote(Puppeteer):
    """A joint held by remote control (OSC, a slider), set by another thread; free until the first message."""

    SNAPSHOT = ("_held",)

    def __init__(self, joint: str, weight: float = 1.0) -> None:
        super().__init__(joint, weight)
        # One tuple, replaced as a whole: the tick sees the old one or the new one, never a mixture.
        self._held: tuple[float, float, float, float] | None = None

    def hold(self, orientation: Sequence[float]) -> None:
        """Hold the joint at a quaternion w, x, y, z of any length but zero. Raises ValueError."""
        self._held = _unit(orientation)

    def hold_axis_angle(self, axis: Sequence[float], angle: float) -> None:
        """Hold the joint turned by angle (radians) about an axis. Raises ValueError."""
        length = math.hypot(*axis)
        if len(axis) != 3 or not 0 < length < math.inf or not math.isfinite(angle):
            raise ValueError(f"The axis {list(axis)} with the angle {angle} is no rotation.")
        sine = math.sin(angle / 2) / length
        self._held = _unit((math.cos(angle / 2), *(sine * value for value in axis)))

    def hold_here(self, orientation: Sequence[float]) -> None:
        """Hold the joint where it is (w, x, y, z), unless an orientation was set before."""
        if self._held is None:
            self.hold(orientation)

    def let_go(self) -> None:
        """Give the joint back to the puppet."""
        self._held = None

    def _holds(self, now: float) -> bool:
        return self._held is not None

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        held = self._held
        if held is not None:
            orientation[:] = held


def _unit(orientation: Sequence[float]) -> tuple[float, float, float, float]:
    length = math.hypot(*orientation)
    if len(orientation) != 4 or not 0 < length < math.inf:
        raise ValueError(f"{list(orientation)} is no orientation: four numbers w, x, y, z are needed.")
    return _four([float(value) / length for value in orientation])


def _four(values: Sequence[float]) -> tuple[float, float, float, float]:
    w, x, y, z = values
    return w, x, y, z
