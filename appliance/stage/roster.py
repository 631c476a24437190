"""The roster: every sensor as it was at the last look, for whoever asks over the control port."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from appliance.sensor.link import SensorState

Message = tuple[str | int | float, ...]  # an OSC address and its arguments

UNKNOWN_S = -1.0  # a round trip or an age that there is none of


class Roster:
    """Written by the stage, read by the control thread: the list is replaced as a whole, never changed."""

    def __init__(self, key_file: str = "") -> None:
        self.key_file = key_file
        self._looked_at = 0.0
        self._sensors: tuple[tuple[SensorState, str], ...] = ()

    def refresh(self, states: Sequence[SensorState], neutral_of: Callable[[str], str], now: float) -> None:
        """How the sensors are now; `neutral_of` tells how a sensor's neutral pose stands, in one word."""
        self._sensors, self._looked_at = tuple((state, neutral_of(state.name)) for state in states), now

    def messages(self, now: float) -> Iterator[Message]:
        """What `/sensors/list` tells: address and arguments of each message, as docs/osc.md has them."""
        sensors = self._sensors
        for state, neutral in sensors:
            yield (
                "/sensors/sensor",
                *(state.name, f"{state.device_id:08x}", state.state, state.way, state.rate_hz, state.loss),
                *(_known(state.round_trip_s), _known(state.age_s), state.battery, state.calibration),
                *(state.flags, state.firmware, state.imu_id, neutral, state.complaint),
            )
        yield "/sensors/end", len(sensors), now - self._looked_at, self.key_file


def _known(seconds: float | None) -> float:
    return UNKNOWN_S if seconds is None else seconds
