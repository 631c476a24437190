"""The roster: each sensor as the stage last saw it, for the page, `bunraku sensors` and `/sensors/list`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

UNKNOWN_S = -1.0  # no round trip or age is known yet


class RosterLine(NamedTuple):
    """One sensor: a line of the stage's health, the arguments of `/sensors/sensor` (docs/osc.md)."""

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


class Roster(NamedTuple):
    """All sensors of a stage, and when it looked, in monotonic seconds; None: it is still starting."""

    lines: list[RosterLine]
    looked_at: float | None

    @classmethod
    def reported(cls, health: Mapping[str, Any]) -> Roster:
        """From a stage's health; lines of another release are left out."""
        lines = [RosterLine(*line) for line in health.get("sensors") or () if len(line) == _FIELDS]
        return cls(lines, health.get("looked_at"))

    def age_s(self, now: float) -> float:
        """UNKNOWN_S while it is starting. The stage may have looked after `now` was read."""
        return UNKNOWN_S if self.looked_at is None else max(0.0, now - self.looked_at)


_FIELDS = len(RosterLine._fields)
