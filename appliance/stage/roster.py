"""The roster: every sensor as it was at the last look, for whoever asks over the control port."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from appliance.sensor.link import SensorState

Message = tuple[str | int | float, ...]  # an OSC address and its arguments
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
    flags: int  # wire.HAS_PROFILE, wire.IS_NDOF
    firmware: str
    imu_id: str
    neutral: str  # taken, wanted, kept, assumed; empty: no hand of the show
    complaint: str


class Roster:
    """Written by the stage, read by the control thread: the list is replaced as a whole, never changed."""

    def __init__(self, key_file: str = "") -> None:
        self._key_file = key_file
        self._looked_at: float | None = None
        self._lines: tuple[RosterLine, ...] = ()

    def refresh(self, states: Sequence[SensorState], neutral_of: Callable[[str], str], now: float) -> None:
        """How the sensors are now; `neutral_of` tells how a sensor's neutral pose stands, in one word."""
        self._lines = tuple(_line(state, neutral_of(state.name)) for state in states)
        self._looked_at = now

    def messages(self, now: float) -> Iterator[Message]:
        """What `/sensors/list` tells: a message for each sensor, and one to end with."""
        lines = self._lines
        for line in lines:
            yield SENSOR, *line
        age_s = UNKNOWN_S if self._looked_at is None else now - self._looked_at
        yield END, len(lines), age_s, self._key_file


def _line(state: SensorState, neutral: str) -> RosterLine:
    return RosterLine(
        name=state.name,
        device_id=f"{state.device_id:08x}",
        state=state.state,
        way=state.way,
        rate_hz=state.rate_hz,
        loss=state.loss,
        round_trip_s=_known(state.round_trip_s),
        age_s=_known(state.age_s),
        battery=state.battery,
        calibration=state.calibration,
        flags=state.flags,
        firmware=state.firmware,
        imu_id=state.imu_id,
        neutral=neutral,
        complaint=state.complaint,
    )


def _known(seconds: float | None) -> float:
    return UNKNOWN_S if seconds is None else seconds
