"""Programs in place of wearables: their datagrams become readings of named sensors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from appliance.sensor.foreign.door import Door
from appliance.sensor.foreign.foreign_sensor import ForeignSensor
from appliance.sensor.foreign.mocopi import mocopi_messages
from appliance.sensor.foreign.sources import BoneSource, OscSource, SourceSettings
from appliance.show_control.packet import messages_in, readable
from appliance.show_control.port import Port, open_port

_AT_ONCE = 64  # datagrams of a port in one turn
_RETRY_S = 2.0
_LONGEST_SAID = 64  # letters of an address
_SAY_EVERY_S = 60.0


@dataclass(frozen=True)
class ForeignPort:
    """A port of the box file: its address, its permitted senders, and the sensors that it moves."""

    host: str
    port: int
    senders: tuple[str, ...]
    sensors: tuple[SourceSettings, ...]


class _Listener:
    """One port and its sensors. Refused datagrams are counted; the newest reason is kept."""

    def __init__(self, settings: ForeignPort, door: Door) -> None:
        self.settings = settings
        self.is_mocopi = any(one.program == "mocopi" for one in settings.sensors)
        self.sensors: list[tuple[OscSource | BoneSource, ForeignSensor]] = [
            (one.source(), ForeignSensor(one.name, one.program, door, one.drifts)) for one in settings.sensors
        ]
        self.port: Port | None = None
        self.trouble = ""
        self.refused, self.reason = 0, ""
        self.heard = self.unheard = 0  # datagrams for a sensor, and those before the first such
        self.unheard_address = ""
        self._retry_at = -math.inf

    def open(self, now: float) -> bool:
        """Open the port where it is not open yet; whether it was opened now."""
        if self.port is not None or now < self._retry_at:
            return False
        self._retry_at = now + _RETRY_S
        try:
            self.port = Port(open_port(self.settings.host, self.settings.port), self.settings.senders)
        except OSError as error:
            names = ", ".join(one.name for one in self.settings.sensors)
            self.trouble = (
                f"UDP port {self.settings.port} on {self.settings.host} cannot be opened for {names} "
                f"({error.strerror}). The dancer moves freely there. Stop the program that has the port, or "
                "give another `port` under sensors: foreign: in the box file."
            )
            return False
        self.trouble = ""
        return True

    def take(self, now: float) -> None:
        """Give what waits at the port to its sensors."""
        for _, sensor in self.sensors:
            sensor.turn(now)
        for _ in range(_AT_ONCE):
            found = None if self.port is None else self.port.take()
            if found is None:
                return
            if found[0]:
                self._hear(found[0], now)

    def close(self) -> None:
        if self.port is not None:
            self.port.close()
        for _, sensor in self.sensors:
            sensor.close()

    def _hear(self, received: bytes, now: float) -> None:
        try:
            messages = mocopi_messages(received) if self.is_mocopi else messages_in(received)
        except ValueError as error:
            self._refuse(str(error))
            return
        for source, sensor in self.sensors:
            try:
                orientation = source.hear(messages, now)
            except ValueError as error:
                self._refuse(str(error))
                continue
            if orientation is not None:
                self.heard += 1
                sensor.take(orientation, now)
        if not self.heard and messages:
            self.unheard, self.unheard_address = self.unheard + 1, messages[0][0][:_LONGEST_SAID]

    @property
    def is_misaddressed(self) -> bool:
        """Whether much came, and nothing of it for its sensors."""
        return not self.heard and self.unheard >= _AT_ONCE

    def _refuse(self, reason: str) -> None:
        self.refused, self.reason = self.refused + 1, reason


class ForeignSensors:
    """All programs that move a sensor. Never waits, never raises."""

    def __init__(self, ports: Sequence[ForeignPort], folder: Path) -> None:
        door = Door(folder)
        self._listeners = [_Listener(one, door) for one in ports]
        self._said: dict[int, tuple[float, int]] = {}

    def opened(self, now: float) -> Iterator[int]:
        """Descriptors of the ports that were opened now, to poll for datagrams."""
        for one in self._listeners:
            if one.open(now) and one.port is not None:
                yield one.port.fileno()

    def take(self, now: float) -> None:
        """Hear every port."""
        for one in self._listeners:
            one.take(now)

    def news(self, now: float) -> Iterator[str]:
        """Sentences about what was not heard; about each port one a minute at most."""
        for place, one in enumerate(self._listeners):
            said_at, count = self._said.get(place, (-math.inf, 0))
            strangers = 0 if one.port is None else one.port.strangers
            faults = one.refused + strangers + bool(one.trouble) + one.is_misaddressed
            if faults == count or now < said_at + _SAY_EVERY_S:
                continue
            self._said[place] = now, faults
            yield self._sentence(one, strangers)

    def close(self) -> None:
        for one in self._listeners:
            with suppress(OSError):
                one.close()

    @staticmethod
    def _sentence(one: _Listener, strangers: int) -> str:
        names, port = ", ".join(sensor.name for _, sensor in one.sensors), one.settings.port
        if one.trouble:
            return one.trouble
        if one.refused:
            return (
                f"Datagrams for {names} at port {port} were refused ({one.refused} so far), the last one: "
                f"{one.reason} The joint is given back where nothing else comes. Check the program."
            )
        if one.is_misaddressed:
            return (
                f"{one.unheard} datagrams came to port {port}, and none of them was for {names}: the last "
                f"one was {readable(one.unheard_address)}. Nothing moves. Correct `address` or `bone` in the "
                "box file, or the program."
            )
        stranger = one.port.newest_stranger if one.port is not None else ""
        return (
            f"{stranger} sends to port {port} for {names} and is not listed ({strangers} dropped so far). "
            "Nothing moves. To let it: `senders` of that sensor in the box file."
        )
