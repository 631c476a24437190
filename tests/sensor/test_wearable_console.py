"""The console of a wearable, over a real pseudo-terminal: lines among packets, refusals, ports in use."""

from __future__ import annotations

import os
import termios

import pytest
import serial

from appliance.sensor.framing import frame
from appliance.sensor.provisioning import wearable_console
from appliance.sensor.provisioning.serial_ports import FoundPort
from appliance.sensor.provisioning.wearable_console import (
    ConsoleError,
    RefusedError,
    TextOnCable,
    WearableConsole,
)
from tests.sensor.fake_console import FakeWearable

pytestmark = pytest.mark.usefixtures("short_settling")


def test_an_imu_that_is_just_starting_is_waited_for_and_one_that_is_missing_is_told() -> None:
    with FakeWearable(ids_before_imu=1) as fake, WearableConsole(fake.port) as console:
        assert console.identify().imu_id
    with FakeWearable(ids_before_imu=1000) as fake, WearableConsole(fake.port) as console:
        assert not console.identify().imu_id


def test_a_line_that_would_not_fit_is_not_sent() -> None:
    with FakeWearable() as fake, WearableConsole(fake.port) as console:
        console.identify()
        for line in ("x" * 129, "set name a\nsave"):
            with pytest.raises(RefusedError):
                console.ask(line)
    assert fake.heard == ["id"]


def test_lines_are_found_among_packets_wherever_the_stream_begins() -> None:
    packet = b"\0" + frame(b"\x07\nok no answer\nerror: none\n" + bytes(20))
    stream = packet + b"ok one\r\n" + packet + packet + b"error: two\r\nok three \xc3\xa9\r\n" + packet
    for begin in range(len(packet) + 1):
        for step in (1, 7, 1000):
            text = TextOnCable()
            lines = [
                line
                for at in range(begin, len(stream), step)
                for line in text.feed(stream[at : min(at + step, len(stream))])
            ]
            assert lines[-3:] == ["ok one", "error: two", "ok three é"]
            assert len(lines) == 3 or 0 < begin < len(packet)
    assert TextOnCable().feed(b"nk saved\r\nok\r\n") == ["nk saved", "ok"]


@pytest.mark.parametrize("sign", ["\x1b[2J", "\x7f", "\x9b31m", "\x90"])
def test_a_line_that_a_terminal_would_obey_is_dropped(sign: str) -> None:
    received = f"ok name {sign}\r\nok caf\u00e9\r\n".encode()
    assert TextOnCable().feed(received) == ["ok caf\u00e9"]


def test_from_the_middle_of_a_packet_it_still_finds_the_wearable() -> None:
    with FakeWearable() as fake:
        interrupted = os.open(fake.port, os.O_RDWR | os.O_NOCTTY)
        os.write(interrupted, b"\0half a packet of a box that was killed")
        with WearableConsole(fake.port) as console:
            assert console.identify().firmware == "1.0.0"
        os.close(interrupted)


def test_a_port_that_another_program_holds_is_said() -> None:
    with FakeWearable() as fake, WearableConsole(fake.port), pytest.raises(ConsoleError, match="in use"):
        WearableConsole(fake.port)


def test_a_cable_that_comes_loose_while_it_is_opened_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def pulled(port: serial.Serial) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(serial.Serial, "_reset_input_buffer", pulled)
    with FakeWearable() as fake, pytest.raises(ConsoleError, match="cannot be opened as a serial port"):
        WearableConsole(fake.port)


def test_a_port_that_is_not_there_is_said_with_what_is(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [FoundPort("/dev/ttyACM1", "", True), FoundPort("/dev/ttyS0", "a modem", False)]
    monkeypatch.setattr(wearable_console, "found_ports", lambda: ports)
    with pytest.raises(ConsoleError, match="no serial port /dev/ttyACM7") as caught:
        WearableConsole("/dev/ttyACM7")
    assert "/dev/ttyACM1 (a wearable's board), /dev/ttyS0 (a modem)" in str(caught.value)
    with pytest.raises(ConsoleError, match="cannot be opened"):
        WearableConsole(__file__)
