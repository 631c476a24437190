"""The neutral pose: how a standing dancer's sensor was mounted and where its heading pointed."""

from __future__ import annotations

from dataclasses import dataclass

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class NeutralPose:
    """How a sensor read while its dancer stood still.

    orientation: unit (w, x, y, z) as read, sensor axes (z up, heading arbitrary). heading: radians about the
    vertical by which the sensor's heading has drifted since; taken out. boot_nonce: of the power-on.
    """

    orientation: Quaternion
    heading: float
    boot_nonce: int
