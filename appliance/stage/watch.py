"""Looks once a second at what a technician must hear about, and says each thing once."""

from __future__ import annotations

from collections.abc import Iterator

from appliance.stage.cast import Cast

SILENT_S = 0.5


class Watch:
    """Remembers what was said about sensors, receivers and the network, so that only changes are said."""

    def __init__(self, cast: Cast) -> None:
        self._cast = cast
        self._silent: set[str] = set()
        self._heard: set[str] = set()
        self._gone: set[str] = set()
        self._dropped: dict[str, int] = {}
        self._network_failed = False

    def news(self, now: float) -> Iterator[str]:
        """Sentences about what changed since the last look; `now` in monotonic seconds."""
        yield from self._sensors(now)
        yield from self._receivers()
        if self._cast.puppet.is_broken != self._network_failed:
            self._network_failed = self._cast.puppet.is_broken
            yield (
                "The network gives poses that are not numbers. The dancer holds the last good pose. "
                "Copy the show bundle again and start anew."
                if self._network_failed
                else "The network gives poses again. The dancer moves."
            )

    def _sensors(self, now: float) -> Iterator[str]:
        for name, joints in self._cast.worn.items():
            silent_s = joints[0].silent_s(now)
            if silent_s <= SILENT_S:
                self._heard.add(name)
                if name in self._silent:
                    self._silent.remove(name)
                    yield f"Sensor {name} is back. It takes its joint again."
            elif name in self._heard and name not in self._silent:
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
