"""The roster: every sensor as the stage last saw it, as messages of the control port."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from appliance.show_control.packet import Message

SENSOR, END = "/sensors/sensor", "/sensors/end"
UNKNOWN_S = -1.0  # a round trip or an age that there is none of; the look of a box that is still starting


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
    calibration: int  # BNO055 register 0x35
    flags: int  # wire.HAS_PROFILE and the others, wire.signal_dbm
    firmware: str
    imu_id: str
    neutral: str  # taken, wanted, kept, assumed; empty: no hand of the show
    complaint: str


def roster_messages(health: Mapping[str, Any], key_file: str, now: float) -> Iterator[Message]:
    """The answer to `/sensors/list`: a message for each sensor, and one to end with.

    `health` as the stage wrote it; empty while it starts.
    """
    lines = [RosterLine(*line) for line in health.get("sensors", ())]
    for line in lines:
        yield SENSOR, *line
    looked_at = health.get("looked_at")
    # The stage may have looked after this process read its clock.
    age_s = UNKNOWN_S if looked_at is None else max(0.0, now - float(looked_at))
    yield END, len(lines), age_s, key_file
