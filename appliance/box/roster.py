"""The roster: each sensor as the stage last saw it, in the order of its health and of `/sensors/sensor`."""

from __future__ import annotations

from typing import NamedTuple

UNKNOWN_S = -1.0  # no round trip or age is known yet


class RosterLine(NamedTuple):
    """One sensor, as the arguments of `/sensors/sensor` in this order; docs/osc.md explains them."""

    name: str
    device_id: str  # 8 hexadecimal digits
    state: str  # absent, greeted, linked, lost
    way: str
    rate_hz: float
    loss: float
    round_trip_s: float
    age_s: float
    battery: int  # percent; 255 unknown
    calibration: int  # system, gyroscope, accelerometer, magnetometer: two bits each, 3 is best
    flags: int  # wire.HAS_PROFILE and the others, wire.signal_dbm
    firmware: str
    imu_id: str
    neutral: str  # taken, wanted, kept, assumed; empty: no hand of the show
    complaint: str
    corrected: float = 0.0  # degrees of drift that were taken out of the heading since it was set
    battery_left_s: float = UNKNOWN_S
