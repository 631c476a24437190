"""A cable that is a pseudo-terminal, a wearable at its end, and waiting for what comes over it."""

from __future__ import annotations

import os
import pty
import select
import time
import tty
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from appliance.sensor import wire
from appliance.sensor.framing import Deframer, frame
from appliance.sensor.link import SensorLink, SensorReading
from tests.sensor.peers import KEYS, Wearable

PATIENCE_S = 60.0


class Cable:
    """A pseudo-terminal under a fixed name, as udev keeps it for a sensor."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self.master = -1

    def plug_in(self) -> None:
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.name.symlink_to(os.ttyname(slave))
        self._slave = slave

    def pull_out(self) -> None:
        self.name.unlink()
        os.close(self._slave)
        os.close(self.master)
        self.master = -1

    def write(self, data: bytes) -> None:
        os.write(self.master, data)

    def read(self) -> bytes:
        """What has come, waited for."""
        ready, _, _ = select.select([self.master], [], [], PATIENCE_S)
        assert ready, "the box never wrote"
        return os.read(self.master, 4096)


class Plugged:
    """A wearable at the end of a cable."""

    def __init__(self, cable: Cable, name: str = "left-wrist", boot: int = 1) -> None:
        self.cable = cable
        self.wearable = Wearable(KEYS[name], boot)
        self.deframer = Deframer(Counter())

    def say(self, packet: bytes) -> None:
        self.cable.write(b"\x00" + frame(packet))

    def hear(self) -> list[wire.Packet]:
        """At least one packet from the box, waited for."""
        packets: list[bytes] = []
        while not packets:
            packets += self.deframer.feed(self.cable.read())
        return [self.wearable.hear(packet) for packet in packets]

    def pair(self, link: SensorLink) -> None:
        self.say(self.wearable.hello())
        run_until(link, lambda: bool(link.sent["assignment"]))
        while not self.wearable.session:
            self.hear()


def await_that(what: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < deadline, "the peer never came"
        time.sleep(0.005)


def run_until(link: SensorLink, what: Callable[[], bool]) -> None:
    """Ticks until something is so."""

    def tick() -> bool:
        link.drain(time.monotonic())
        link.send_due(time.monotonic())
        return what()

    await_that(tick)


def await_reading(link: SensorLink) -> SensorReading:
    readings: list[SensorReading] = []
    await_that(lambda: bool(readings.extend(link.drain(time.monotonic())) or readings))
    return readings[-1]
