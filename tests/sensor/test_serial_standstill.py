"""A serial port that stands still: what waits is bounded and counted, and closing ends its thread."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress

import pytest
import serial

from appliance.sensor.framing import frame
from appliance.sensor.link import SensorLink
from appliance.sensor.transports.serial import UNSENT_PACKETS, SerialIntake
from tests.sensor.cable import PATIENCE_S, Cable, Plugged, await_that
from tests.sensor.peers import KEYS, Wearable


def test_packets_that_nobody_fetches_are_dropped_oldest_first(
    cable: Cable, opened: tuple[SensorLink, SerialIntake]
) -> None:
    link, intake = opened
    sensor = Plugged(cable)
    sensor.pair(link)
    for n in range(300):
        sensor.say(sensor.wearable.reading(degrees=n))
    await_that(lambda: intake.counts["serial_overrun"] >= 300 - 128)
    newest: list[int] = []

    def is_heard() -> bool:
        newest.extend(reading.sequence for reading in link.drain(time.monotonic()))
        return newest[-1:] == [300]

    await_that(is_heard)
    assert link.counts["accepted"] <= 129, "the oldest were heard"


def test_what_cannot_be_written_is_dropped_and_counted(cable: Cable) -> None:
    """Without a cable, and where nobody reads at the other end; reading goes on meanwhile."""
    intake = SerialIntake(str(cable.name))
    intake.send_packet(b"packet", ())
    assert intake.counts["send_error"] == 1
    cable.plug_in()
    await_that(lambda: intake.trouble is None)

    def stuff() -> bool:
        for _ in range(UNSENT_PACKETS):
            intake.send_packet(bytes(60), ())
        return intake.counts["send_error"] > UNSENT_PACKETS

    await_that(stuff)
    link = SensorLink(KEYS, [intake])
    cable.write(frame(Wearable(KEYS["head"]).hello()))
    await_that(lambda: link.drain(time.monotonic()) == () and link.counts["hello"] == 1)
    link.close()
    cable.pull_out()


def test_a_write_that_timed_out_as_the_thread_stood_still_drops_nothing_that_waits(cable: Cable) -> None:
    """pyserial looks at the time after its bytes have left, too."""
    intake = SerialIntake(str(cable.name))
    ours, theirs = socket.socketpair()
    with ours, theirs:
        port = TimedOut(ours)
        intake._unsent.append(b"next")
        intake._write(port, b"packet")
        assert (list(intake._unsent), intake.counts["send_error"]) == ([b"next"], 1)
        ours.setblocking(False)
        with suppress(BlockingIOError):  # nobody reads
            while True:
                ours.send(bytes(4096))
        intake._write(port, b"packet")
        assert (list(intake._unsent), intake.counts["send_error"]) == ([], 3)
    intake.close()


class TimedOut(serial.Serial):
    """A port whose writes come to no end in time."""

    def __init__(self, wire: socket.socket) -> None:
        super().__init__()
        self._wire = wire

    def fileno(self) -> int:
        return self._wire.fileno()

    def write(self, data: bytes) -> int:
        raise serial.SerialTimeoutException("Write timeout")


def test_a_device_that_never_opens_does_not_keep_the_box_from_ending(
    cable: Cable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a driver does whose device has died: the call does not come back."""
    is_opening, gives_way = threading.Event(), threading.Event()

    def dead(*_: object, **__: object) -> None:
        is_opening.set()
        gives_way.wait(PATIENCE_S)
        raise serial.SerialException("dead")

    monkeypatch.setattr(serial, "Serial", dead)
    intake = SerialIntake(str(cable.name))
    assert is_opening.wait(PATIENCE_S)
    closing = threading.Thread(target=intake.close, daemon=True)
    closing.start()
    closing.join(PATIENCE_S / 2)
    assert not closing.is_alive()
    gives_way.set()


def test_closing_ends_the_thread_with_and_without_a_cable(cable: Cable) -> None:
    absent = SerialIntake(str(cable.name))
    absent.close()
    cable.plug_in()
    present = SerialIntake(str(cable.name))
    await_that(lambda: present.trouble is None)
    present.close()
    assert not absent._thread.is_alive()
    assert not present._thread.is_alive()
    cable.pull_out()
