"""The neutral pose: from a sensor's readings to its joint, for any mounting and any heading.

Sensor axes are those of the wire: z up, heading arbitrary. Stage axes: y up, the dancer faces +z and has x
on the left. A permutation maps one to the other, world and body alike: a sensor with its x axis (the arrow on
its case) to the front and z up reads the identity in both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

NO_BOOT = -1  # boot_nonce of an assumed pose
STILL_S = 1.5  # how long a dancer stands still after switching on
_STILL_COSINE = math.cos(math.radians(3.0) / 2)  # cosine of half the angle, as in a product of quaternions
_GAP_S = 0.25  # after a longer silence stillness starts again
_LEVEL = math.sin(math.radians(15.0))  # an axis nearer to the vertical has no usable heading
_ARROW, _LID = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)  # axes of the case: along its arrow, out of its lid
_STAGE_FROM_SENSOR = [0, 2, 3, 1]  # places of w, x, y, z


@dataclass(frozen=True)
class NeutralPose:
    """How a sensor read while its dancer stood still.

    orientation: unit (w, x, y, z) as read, sensor axes. heading: how far the sensor's heading has moved since
    (drift, a restart of its IMU), radians about the vertical; taken out. boot_nonce: of that power-on.
    """

    orientation: Quaternion
    heading: float
    boot_nonce: int


@dataclass(frozen=True)
class Mounting:
    """How the sensor of one hand is mounted.

    facing: unit sensor axis that points to the front in the neutral pose. at_neutral: the joint's local
    orientation then, stage axes. assumed: the neutral orientation, sensor axes, until one is taken.
    """

    facing: Vector = _ARROW
    at_neutral: Quaternion = (1.0, 0.0, 0.0, 0.0)
    assumed: Quaternion = (1.0, 0.0, 0.0, 0.0)

    @property
    def assumed_pose(self) -> NeutralPose:
        """The neutral pose until one is taken."""
        return NeutralPose(self.assumed, 0.0, NO_BOOT)


class Stillness:
    """Whether a sensor stays within 3 degrees of where it was; time is an argument, in seconds."""

    SNAPSHOT = ("_anchor", "_since", "_heard")
    TIMES = ("_since", "_heard")

    def __init__(self) -> None:
        self._anchor: Quaternion = (
            0.0,
            0.0,
            0.0,
            0.0,
        )  # far from every orientation: the first reading starts
        self._since = self._heard = -math.inf

    @property
    def still_s(self) -> float:
        """How long the sensor had been still at its last reading."""
        return self._heard - self._since if self._since > -math.inf else 0.0

    def add_reading(self, orientation: Quaternion, now: float) -> None:
        """Add the next reading, a unit quaternion of either sign, in any axes."""
        a, b = self._anchor, orientation
        cosine = abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])
        if cosine < _STILL_COSINE or now - self._heard > _GAP_S:
            self._anchor, self._since = orientation, now
        self._heard = now

    def restart(self) -> None:
        """Start again: earlier readings no longer count."""
        self._anchor = (0.0, 0.0, 0.0, 0.0)
        self._since = -math.inf


def to_stage(orientation: Sequence[float] | NDArray[np.floating]) -> NDArray[np.float64]:
    """A rotation as a quaternion (4,), from sensor axes to stage axes."""
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
    """Heading of the dancer's front (radians, as facing_heading) and the sensor axis that it comes from.

    The axis is `facing`, or where that stands upright the arrow on the case or the normal of its lid: one of
    them is level.
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
    return np.ascontiguousarray(images.T, np.float32)  # as keyframes store it: products equal to the last bit


def turned(before: Quaternion, after: Quaternion) -> float | None:
    """Difference in heading between two readings in sensor axes, radians in -pi..pi.

    Turning `after` back by it about the vertical brings it as near to `before` as possible; tilt counts as
    zero. None when one is upside down against the other: the heading is then undefined.
    """
    w, _, _, z = quaternion.multiply(np.array(after), quaternion.inverse(np.array(before)))
    if math.hypot(w, z) < _LEVEL:
        return None
    return _wrapped(2.0 * math.atan2(z, w))


def with_heading_reset(pose: NeutralPose, reading: Quaternion) -> NeutralPose | None:
    """The pose for a dancer facing the front again: without drift, same tilt. None: undefined."""
    drift = turned(pose.orientation, reading)
    return None if drift is None else replace(pose, heading=drift)


def carried(pose: NeutralPose, before: Quaternion, reading: Quaternion, boot_nonce: int) -> NeutralPose:
    """The pose for a sensor that lost its heading: tilt from the new reading, heading as in `before`."""
    lost = turned(before, reading) or 0.0
    return NeutralPose(pose.orientation, _wrapped(pose.heading + lost), boot_nonce)


def _about_vertical(angle: float) -> NDArray[np.float64]:
    """Y(angle): the rotation about +y, stage axes."""
    return np.array([math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0])


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)
