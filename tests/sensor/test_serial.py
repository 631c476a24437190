"""Over a real pseudo-terminal: pairing, damage, and a cable that is pulled out and put in again."""

from __future__ import annotations

import os
import pty
import select
import socket
import threading
import time
import tty
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import serial

from appliance.sensor import wire
from appliance.sensor.framing import Deframer, frame
from appliance.sensor.link import SensorLink, SensorReading, open_link
from appliance.sensor.transports.serial import UNSENT_PACKETS, SerialIntake
from appliance.sensor.transports.udp import UdpIntake
from tests.sensor.peers import KEYS, Wearable

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


@pytest.fixture
def cable(tmp_path: Path) -> Cable:
    return Cable(tmp_path / "sensor")


@pytest.fixture
def opened(cable: Cable) -> Iterator[tuple[SensorLink, SerialIntake]]:
    """A link over the plugged cable, and its intake."""
    cable.plug_in()
    link = open_link(KEYS, serial=[(str(cable.name), 115200)])
    (intake,) = link.intakes
    assert isinstance(intake, SerialIntake)
    await_that(lambda: intake.trouble is None)
    yield link, intake
    link.close()
    cable.pull_out()


def test_a_sensor_pairs_over_a_cable(cable: Cable, opened: tuple[SensorLink, SerialIntake]) -> None:
    link, _ = opened
    sensor = Plugged(cable)
    sensor.pair(link)
    sensor.say(sensor.wearable.reading())
    reading = await_reading(link)
    assert (reading.sensor, reading.sequence) == ("left-wrist", 1)
    assert reading.arrival <= time.monotonic()
    link.send_due(time.monotonic())
    (heartbeat,) = sensor.hear()
    assert isinstance(heartbeat, wire.Heartbeat)
    assert heartbeat.echo_sequence == 1
    (state, _) = link.states(time.monotonic())
    assert (state.state, state.way) == ("linked", str(cable.name))


def test_every_frame_stands_between_two_zero_bytes(
    cable: Cable, opened: tuple[SensorLink, SerialIntake]
) -> None:
    """So that half a line that a person typed, or half a frame, spoils nothing."""
    _, intake = opened
    intake.send_packet(b"packet", ())
    written = b""
    while len(written) < len(frame(b"packet")) + 1:
        written += cable.read()
    assert written == b"\x00" + frame(b"packet")


def test_damage_and_lines_for_people_between_frames(
    cable: Cable, opened: tuple[SensorLink, SerialIntake]
) -> None:
    link, _ = opened
    sensor = Plugged(cable)
    sensor.pair(link)
    cable.write(frame(sensor.wearable.reading())[7:] + b"ok saved\r\n")
    sensor.say(sensor.wearable.reading())
    assert await_reading(link).sequence == 2
    assert sum(count for reason, count in link.counts.items() if reason.startswith("frame_")) == 2


def test_unplugged_and_plugged_in_again(cable: Cable) -> None:
    intake = SerialIntake(str(cable.name))
    link = SensorLink(KEYS, [intake])
    await_that(lambda: "Plug it in" in (intake.trouble or ""))  # it is not there yet
    for boot in (1, 2):
        cable.plug_in()
        await_that(lambda: intake.trouble is None)
        link.sent.clear()
        sensor = Plugged(cable, boot=boot)
        sensor.pair(link)
        sensor.say(sensor.wearable.reading())
        assert await_reading(link).boot_nonce == boot
        cable.pull_out()
        await_that(lambda: intake.trouble is not None)
        assert link.drain(time.monotonic()) == ()
    assert link.counts["serial_error"] >= 3
    link.close()


def test_from_the_network_to_a_cable_and_back(cable: Cable) -> None:
    link = open_link(KEYS, udp=("127.0.0.1", 0), serial=[(str(cable.name), 115200)])
    network, intake = link.intakes
    assert isinstance(network, UdpIntake) and isinstance(intake, SerialIntake)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.connect(network.address)
        radio.settimeout(PATIENCE_S)
        cable.plug_in()
        await_that(lambda: intake.trouble is None)
        plugged = Plugged(cable)
        sensor = plugged.wearable
        ways, sessions = [], set()
        for by_cable in (False, True, False, True):
            say = plugged.say if by_cable else radio.send
            say(sensor.hello())
            assignments = link.sent["assignment"]
            run_until(link, lambda before=assignments: link.sent["assignment"] > before)  # type: ignore[misc]
            while not isinstance(
                plugged.hear()[-1] if by_cable else sensor.hear(radio.recv(200)), wire.Assignment
            ):
                pass
            for _ in range(3):
                say(sensor.reading())
                assert await_reading(link).sequence == sensor.sequence
            ways.append(link.states(time.monotonic())[0].way)
            sessions.add(sensor.session)
        address = f"127.0.0.1:{radio.getsockname()[1]}"
    assert ways == [address, str(cable.name)] * 2
    assert len(sessions) == 1
    assert link.counts["accepted"] == 12
    link.close()
    cable.pull_out()


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


def test_what_came_since_the_tick_read_its_time_came_when_it_did(cable: Cable) -> None:
    intake = SerialIntake(str(cable.name))
    intake._packets.extend([(b"before", 99.99), (b"since", 100.7), (b"on another clock", 7000.0)])
    assert [arrival for _, arrival, _ in intake.receive_packets(100.0)] == [99.99, 100.7, 100.0]
    intake.close()


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
