"""Battery life: how long a sensor's battery lasts yet, by the pace at which its percentage falls.

A percentage says little to a person; minutes say whether the battery lasts for the evening. They are known
after a while only, and err on the short side: of two paces the faster counts, the one since the start and the
one of the last stretch; the last few percent, where the voltage collapses, do not count.
"""

from __future__ import annotations

from collections.abc import Iterable

from appliance.sensor.state import SensorState
from appliance.sensor.wire import BATTERY_UNKNOWN

UNKNOWN_S = -1.0
_LEAST_FALL = 3  # percent, and
_LEAST_S = 600.0  # seconds, before a pace is believed
_STRETCH = 5  # falls of one percent that make the last stretch
_EMPTY = 5  # percent
_LOADED = 3  # percent: a rise by so much is a charger, or another battery
_LONGEST_STEP_S = 5.0  # a longer pause was not looked at
_LINKED = "linked"


class BatteryLife:
    """One battery. Only time in which it is heard counts; time is an argument, in seconds.

    Falls are noted when a new lowest percentage is reached, so that noise of the measurement does not count.
    """

    def __init__(self) -> None:
        self._on_s = 0.0
        self._looked_at: float | None = None
        self._falls: list[tuple[float, int]] = []  # seconds on, percent; the first is the start

    def hear(self, percent: int, now: float) -> None:
        """Add the newest percentage."""
        if self._looked_at is not None:
            self._on_s += min(max(0.0, now - self._looked_at), _LONGEST_STEP_S)
        self._looked_at = now
        lowest = self._falls[-1][1] if self._falls else BATTERY_UNKNOWN
        if percent >= lowest + _LOADED:
            self._falls, self._on_s = [], 0.0
        if not self._falls or percent < self._falls[-1][1]:
            self._falls.append((self._on_s, percent))

    def pause(self) -> None:
        """It is not heard: time does not count until it is."""
        self._looked_at = None

    @property
    def left_s(self) -> float:
        """Seconds that are left; UNKNOWN_S until enough was seen."""
        if len(self._falls) < 2:
            return UNKNOWN_S
        since, latest = self._falls[1], self._falls[-1]  # the first one may have been reached long before
        fallen, took = since[1] - latest[1], latest[0] - since[0]
        if fallen < _LEAST_FALL or took < _LEAST_S:
            return UNKNOWN_S
        recent = self._falls[-1 - min(_STRETCH, len(self._falls) - 2)]
        pace = max(fallen / took, (recent[1] - latest[1]) / max(latest[0] - recent[0], 1.0))
        left = (latest[1] - _EMPTY) / pace - (self._on_s - latest[0])
        return max(0.0, left)


class BatteryLives:
    """The batteries of all sensors, by wearable: a replaced sensor starts anew."""

    def __init__(self) -> None:
        self._lives: dict[str, tuple[int, BatteryLife]] = {}

    def hear(self, states: Iterable[SensorState], now: float) -> None:
        """Look at all sensors; call it about once a second."""
        for state in states:
            known = self._lives.get(state.name)
            if known is None or known[0] != state.device_id:
                known = self._lives[state.name] = state.device_id, BatteryLife()
            life = known[1]
            if state.state == _LINKED and state.battery != BATTERY_UNKNOWN:
                life.hear(state.battery, now)
            else:
                life.pause()

    def left_s(self, name: str) -> float:
        """Seconds that a sensor's battery lasts yet; UNKNOWN_S where nobody can say."""
        known = self._lives.get(name)
        return UNKNOWN_S if known is None else known[1].left_s
