"""Over a real pseudo-terminal: framed readings, damage, and a cable that is pulled out and put in again."""

from __future__ import annotations

import os
import pty
import time
import tty
from collections.abc import Callable
from pathlib import Path

import pytest

from appliance.sensor.framing import frame
from appliance.sensor.link import SensorLink, SensorReading, open_link
from appliance.sensor.serial import SerialIntake
from tests.sensor.test_link import KEYS, datagram

PATIENCE_S = 20.0


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


def await_that(what: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < deadline, "the peer never came"
        time.sleep(0.005)


def await_reading(link: SensorLink) -> SensorReading:
    readings: list[SensorReading] = []
    await_that(lambda: bool(readings.extend(link.drain(time.monotonic())) or readings))
    return readings[-1]


@pytest.fixture
def cable(tmp_path: Path) -> Cable:
    return Cable(tmp_path / "sensor")


def test_readings_damage_and_the_way_back(cable: Cable) -> None:
    cable.plug_in()
    link = open_link(KEYS, serial=[(str(cable.name), 115200)])
    (intake,) = link.intakes
    assert isinstance(intake, SerialIntake)
    await_that(lambda: intake.trouble is None)
    cable.write(frame(datagram(1))[7:] + frame(datagram(2)))
    reading = await_reading(link)
    assert (reading.sensor, reading.sequence) == ("left-wrist", 2)
    assert reading.arrival <= time.monotonic()
    assert sum(link.counts[reason] for reason in link.counts if reason.startswith("frame_")) == 1
    link.close()
    cable.pull_out()


def test_unplugged_and_plugged_in_again(cable: Cable) -> None:
    intake = SerialIntake(str(cable.name))
    link = SensorLink(KEYS, [intake])
    await_that(lambda: "Plug it in" in (intake.trouble or ""))  # it is not there yet
    for round_number in range(2):
        cable.plug_in()
        await_that(lambda: intake.trouble is None)
        cable.write(frame(datagram(10 + round_number)))
        assert await_reading(link).sequence == 10 + round_number
        cable.pull_out()
        await_that(lambda: intake.trouble is not None)
        assert link.drain(time.monotonic()) == ()
    assert link.counts["serial_error"] >= 3
    link.close()


def test_packets_that_nobody_fetches_are_dropped_oldest_first(cable: Cable) -> None:
    cable.plug_in()
    intake = SerialIntake(str(cable.name))
    link = SensorLink(KEYS, [intake])
    await_that(lambda: intake.trouble is None)
    for n in range(300):
        cable.write(frame(datagram(n, degrees=n)))
    await_that(lambda: intake.counts["serial_overrun"] >= 300 - 128)
    assert await_reading(link).sequence == 299
    link.close()
    cable.pull_out()


def test_closing_ends_the_thread_with_and_without_a_cable(cable: Cable) -> None:
    absent = SerialIntake(str(cable.name))
    absent.close()
    cable.plug_in()
    present = SerialIntake(str(cable.name))
    present.close()
    assert not absent._thread.is_alive()
    assert not present._thread.is_alive()
    cable.pull_out()
