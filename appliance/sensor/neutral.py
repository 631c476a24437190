"""The neutral pose: from a sensor's readings to its joint, however it is worn and wherever its north lies.

Sensor axes are those of the BNO055: z up, heading arbitrary. Stage axes: y up, the dancer faces +z and has x
on the left. A permutation turns the ones into the others, world and body alike, so that a sensor whose x axis
(the arrow on its case) points to the front, z up, reads the identity in both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

NO_BOOT = -1  # boot_nonce of a pose that no power-on gave
STILL_S = 1.5  # so long must a dancer stand still after switching on
_STILL_COSINE = math.cos(math.radians(3.0) / 2)  # of half the angle, as the product of two quaternions has it
_GAP_S = 0.25  # after a longer silence nobody knows whether the sensor was still
_LEVEL = math.sin(math.radians(15.0))  # an axis nearer to the vertical has no heading worth the name
_ARROW, _LID = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)  # axes of the case: along its arrow, out of its lid
_STAGE_FROM_SENSOR = [0, 2, 3, 1]  # places of w, x, y, z


@dataclass(frozen=True)
class NeutralPose:
    """How a sensor read while its dancer stood still.

    orientation: unit (w, x, y, z) as read, sensor axes. heading: radians about the vertical that the sensor's
    heading has moved by since (drift, a restart of its IMU); taken out. boot_nonce: of that power-on.
    """

    orientation: Quaternion
    heading: float
    boot_nonce: int


@dataclass(frozen=True)
class Mounting:
    """How one hand's sensor is worn.

    facing: unit sensor axis that points to the front in the neutral pose. at_neutral: the joint's local
    orientation then, stage axes. assumed: the neutral orientation, sensor axes, until one was taken.
    """

    facing: Vector = _ARROW
    at_neutral: Quaternion = (1.0, 0.0, 0.0, 0.0)
    assumed: Quaternion = (1.0, 0.0, 0.0, 0.0)

    @property
    def assumed_pose(self) -> NeutralPose:
        """The neutral pose until one was taken."""
        return NeutralPose(self.assumed, 0.0, NO_BOOT)


class Stillness:
    """Whether a sensor stays within 3 degrees of where it was; time is an argument, in seconds."""

    def __init__(self) -> None:
        self._anchor: Quaternion = (0.0, 0.0, 0.0, 0.0)  # far from everything: the first reading begins
        self._since = self._heard = -math.inf

    @property
    def still_s(self) -> float:
        """For how long the sensor had not moved when it was last heard."""
        return self._heard - self._since if self._since > -math.inf else 0.0

    def hear(self, orientation: Quaternion, now: float) -> None:
        """Take the next reading, a unit quaternion of either sign, in any axes."""
        a, b = self._anchor, orientation
        cosine = abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])
        if cosine < _STILL_COSINE or now - self._heard > _GAP_S:
            self._anchor, self._since = orientation, now
        self._heard = now

    def state(self) -> tuple[Quaternion, float, float]:
        """What it remembers, for `restore`."""
        return self._anchor, self._since, self._heard

    def restore(self, state: Sequence[Any]) -> None:
        """Go on as the one did that gave this state."""
        (w, x, y, z), self._since, self._heard = state
        self._anchor = (w, x, y, z)

    def restart(self) -> None:
        """What was before does not count any more."""
        self._anchor = (0.0, 0.0, 0.0, 0.0)
        self._since = -math.inf


def to_stage(orientation: Sequence[float] | NDArray[np.floating]) -> NDArray[np.float64]:
    """A quaternion (4,) in sensor axes as the same rotation in stage axes."""
    return np.asarray(orientation, dtype=np.float64)[_STAGE_FROM_SENSOR]


def facing_heading(orientation: Quaternion, facing: Vector) -> float | None:
    """Heading of the facing axis, radians about +y from +z, for an orientation in sensor axes.

    None where the axis stands within 15 degrees of the vertical: then it has none.
    """
    forward, left, up = quaternion.rotate(np.array(orientation, dtype=np.float64), np.array(facing))
    if math.hypot(forward, left) < _LEVEL * math.hypot(forward, left, up):
        return None
    return math.atan2(left, forward)


def front(orientation: Quaternion, facing: Vector) -> tuple[float, Vector]:
    """Heading of the dancer's front (radians, as facing_heading) and the sensor axis that told it.

    That is `facing`, or where it stands upright the arrow on the case, or the normal of its lid: one of them
    lies level.
    """
    for axis in (facing, _ARROW, _LID):
        heading = facing_heading(orientation, axis)
        if heading is not None:
            return heading, axis
    raise ValueError(f"{orientation} is no orientation")


def joint_from_reading(pose: NeutralPose, mounting: Mounting) -> NDArray[np.float32]:
    """The (4, 4) matrix that makes a reading (w, x, y, z; sensor axes) the joint's local orientation.

    With n the neutral orientation in stage axes, psi the dancer's heading in it and delta the drift:
    joint = Y(-psi - delta) reading n^-1 Y(psi) at_neutral. The body above the joint counts as upright.
    """
    psi, _ = front(pose.orientation, mounting.facing)
    to_front = _about_vertical(-psi - pose.heading)
    back = quaternion.multiply(quaternion.inverse(to_stage(pose.orientation)), _about_vertical(psi))
    back = quaternion.multiply(back, np.array(mounting.at_neutral, dtype=np.float64))
    units = np.eye(4)[:, _STAGE_FROM_SENSOR]  # row k: what a 1 in place k of a reading is in stage axes
    images = quaternion.multiply(quaternion.multiply(to_front, units), back)
    return np.ascontiguousarray(images.T, np.float32)  # as a keyframe gives it back: products to the last bit


def turned(before: Quaternion, after: Quaternion) -> float | None:
    """By how much the heading differs between two readings in sensor axes, radians in -pi..pi.

    Turning `after` back by it about the vertical brings it as near to `before` as that can; a difference in
    tilt alone is none. None where one hangs upside down against the other: then no heading can be told.
    """
    w, _, _, z = quaternion.multiply(np.array(after), quaternion.inverse(np.array(before)))
    if math.hypot(w, z) < _LEVEL:
        return None
    return _wrapped(2.0 * math.atan2(z, w))


def with_heading_reset(pose: NeutralPose, reading: Quaternion) -> NeutralPose | None:
    """The pose for a dancer who faces the front again: drift is out, tilt as it was. None: cannot be told."""
    drift = turned(pose.orientation, reading)
    return None if drift is None else replace(pose, heading=drift)


def carried(pose: NeutralPose, before: Quaternion, reading: Quaternion, boot_nonce: int) -> NeutralPose:
    """The pose for a sensor that lost its heading: tilt by the new reading, heading as `before` had it."""
    lost = turned(before, reading) or 0.0
    return NeutralPose(pose.orientation, _wrapped(pose.heading + lost), boot_nonce)


def _about_vertical(angle: float) -> NDArray[np.float64]:
    """Y(angle): the rotation about +y, stage axes."""
    return np.array([math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0])


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)
