"""Looks once a second at what a technician must hear about, and says each thing once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence, Set

from appliance.sensor import wire
from appliance.sensor.state import LOW_BATTERY, SensorState
from appliance.stage.stage_parts import StageParts

SILENT_S = 0.5
CHARGED = 25  # percent: above it a low battery may be said again


class Watch:
    """Remembers what was said about sensors, receivers and the network, so that only changes are said."""

    def __init__(self, cast: StageParts) -> None:
        self._cast = cast
        self._silent: set[str] = set()
        self._ways: dict[str, str] = {}
        self._complaints: set[str] = set()
        self._low: set[str] = set()
        self._gone: set[str] = set()
        self._dropped: dict[str, int] = {}
        self._network_failed = False

    def news(self, now: float, sensors: Sequence[SensorState] = ()) -> Iterator[str]:
        """Sentences about what changed since the last look; `now` in monotonic seconds.

        `sensors`: how the link sees each of them at this moment.
        """
        for sensor in sensors:
            yield from self._links(sensor)
        yield from self._silences(now, {sensor.name for sensor in sensors})
        yield from self._receivers()
        if self._cast.puppet.is_broken != self._network_failed:
            self._network_failed = self._cast.puppet.is_broken
            yield (
                "The network gives poses that are not numbers. The dancer holds the last good pose. "
                "Copy the show bundle again and start anew."
                if self._network_failed
                else "The network gives poses again. The dancer moves."
            )

    def _links(self, sensor: SensorState) -> Iterator[str]:
        """What a person should know of one sensor's link, battery and firmware."""
        name, way_before = sensor.name, self._ways.get(sensor.name)
        if sensor.state == "linked" and sensor.way and sensor.way != way_before:
            self._ways[name] = sensor.way
            yield (
                f"Sensor {name} now speaks by {sensor.way}. The dance goes on."
                if way_before
                else f"Sensor {name} is linked by {sensor.way}, {self._holds(name)}."
            )
        if sensor.complaint and sensor.complaint not in self._complaints:
            self._complaints.add(sensor.complaint)
            yield sensor.complaint
        if sensor.battery < LOW_BATTERY and name not in self._low:
            self._low.add(name)
            yield f"Sensor {name}: {sensor.battery} % of its battery left. The dance goes on. Charge it soon."
        elif CHARGED <= sensor.battery != wire.BATTERY_UNKNOWN:
            self._low.discard(name)

    def _holds(self, name: str) -> str:
        joints = [puppeteer.joint for puppeteer in self._cast.worn.get(name, ())]
        return f"and holds {', '.join(joints)}" if joints else "and holds no joint of this show"

    def _silences(self, now: float, known: Set[str]) -> Iterator[str]:
        """`known`: who has a key; one that was revoked is silent for good, and that was said."""
        for name, joints in self._cast.worn.items():
            silent_s = joints[0].silent_s(now)
            if silent_s <= SILENT_S:
                if name in self._silent:
                    self._silent.remove(name)
                    yield f"Sensor {name} is back. It takes its joint again."
            elif silent_s < math.inf and name not in self._silent and name in known:
                self._silent.add(name)
                yield (
                    f"Sensor {name} silent for {silent_s:.1f} s. The dancer moves freely. Check its battery."
                )

    def _receivers(self) -> Iterator[str]:
        for receiver in self._cast.outputs.receivers:
            dropped_before, self._dropped[receiver.name] = (
                self._dropped.get(receiver.name, 0),
                receiver.dropped,
            )
            is_gone = receiver.dropped > dropped_before
            if is_gone and receiver.name not in self._gone:
                self._gone.add(receiver.name)
                yield (
                    f"Receiver {receiver.name} does not get the dance: {receiver.last_error}. "
                    "The others go on, and it is tried again each second. Start it, or check its address."
                )
            elif not is_gone and receiver.name in self._gone:
                self._gone.remove(receiver.name)
                yield f"Receiver {receiver.name} gets the dance again."
