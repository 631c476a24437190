"""Open DMX: what leaves the cable and when, on a pseudo-terminal and on a port that writes down times."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import termios
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from appliance.outputs.dmx import open_dmx
from appliance.outputs.dmx.adapter_wire import AdapterError
from appliance.outputs.dmx.open_dmx import OpenDmx, open_dmx_wire
from tests.outputs.dmx.conftest import PATIENCE_S, config, universe

Until = Callable[[Callable[[], bool]], None]


class Port:
    """A serial port that writes down what happens to it, and when."""

    def __init__(self) -> None:
        self.events: list[tuple[str, float, bytes]] = []

    @property
    def break_condition(self) -> bool:
        return False

    @break_condition.setter
    def break_condition(self, is_on: bool) -> None:
        self.events.append(("break" if is_on else "mark", time.monotonic(), b""))

    def reset_input_buffer(self) -> None:
        self.events.append(("emptied", time.monotonic(), b""))

    def write(self, data: bytes) -> int:
        self.events.append(("data", time.monotonic(), data))
        return len(data)


def test_break_mark_and_slots_are_as_long_as_dmx_wants(monkeypatch: pytest.MonkeyPatch) -> None:
    port = Port()
    monkeypatch.setattr(open_dmx, "open_port", lambda *_, **__: port)
    cable = OpenDmx("cable", 512)
    for _ in range(10):
        cable.write(universe())
    times = {kind: [at for what, at, _ in port.events if what == kind] for kind in ("break", "mark", "data")}
    breaks = [mark - start for start, mark in zip(times["break"], times["mark"], strict=True)]
    marks = [data - mark for mark, data in zip(times["mark"], times["data"], strict=True)]
    assert min(breaks) >= 92e-6
    assert min(marks) >= 12e-6
    # 513 slots of 44 us have to be out before the next break begins.
    assert all(
        after - data >= 513 * 44e-6 for data, after in zip(times["data"], times["break"][1:], strict=False)
    )
    assert {data for what, _, data in port.events if what == "data"} == {b"\0" + universe()}


def test_what_a_hanging_cable_has_not_taken_is_thrown_away_before_the_next_break(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Hanging(Port):
        """Takes some slots, and then for too long none."""

        def write(self, data: bytes) -> int:
            super().write(data)
            raise serial.SerialTimeoutException("Write timeout")

        def reset_output_buffer(self) -> None:
            self.events.append(("thrown away", time.monotonic(), b""))
            raise OSError("unplugged")

    port = Hanging()
    monkeypatch.setattr(open_dmx, "open_port", lambda *_, **__: port)
    cable = OpenDmx("cable", 512)
    for _ in range(2):
        with pytest.raises(AdapterError, match="it takes no more data"):
            cable.write(universe())
    assert [what for what, _, _ in port.events] == 2 * ["break", "mark", "emptied", "data", "thrown away"]
    thrown_at, next_break_at = port.events[4][1], port.events[5][1]
    assert next_break_at - thrown_at >= 513 * 44e-6  # what the chip has taken leaves it meanwhile


def test_the_port_speaks_250000_baud_with_two_stop_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[object, ...]] = []
    monkeypatch.setattr(open_dmx, "open_port", lambda *settings, **_: opened.append(settings))
    OpenDmx("/dev/ttyUSB0", 512)
    assert opened == [("/dev/ttyUSB0", 250_000, 2)]


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[tuple[int, Path]]:
    """A pseudo-terminal: the end that listens, and the device."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    path = tmp_path / "ttyUSB3"
    path.symlink_to(os.ttyname(slave))
    yield master, path
    os.close(slave)
    os.close(master)


def heard(master: int) -> bytes:
    """What comes next; the time limit is for a broken program alone."""
    assert select.select([master], [], [], PATIENCE_S)[0], "nothing came"
    return os.read(master, 4096)


def test_a_universe_is_told_again_and_again(cable: tuple[int, Path]) -> None:
    master, path = cable
    wire = open_dmx_wire(config("open-dmx", device=str(path)))
    wire.send_universe(universe(), 0.0)
    received = b""
    while len(received) < 6 * 513:
        received += heard(master)
    assert received[: 6 * 513] == (b"\0" + universe()) * 6
    assert wire.dropped == 0
    wire.send_universe(bytes(512), 0.0)
    wire.close()
    while not received.endswith(bytes(513)):
        received += heard(master)


def test_nothing_is_told_before_there_is_something(cable: tuple[int, Path], until: Until) -> None:
    master, path = cable
    os.set_blocking(master, False)
    wire = open_dmx_wire(config("open-dmx", device=str(path)))
    until(lambda: wire.is_open)
    wire.close()
    with pytest.raises(BlockingIOError):
        os.read(master, 1)


def test_request_to_send_is_off_or_the_cable_would_listen(
    cable: tuple[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pseudo-terminal has no such line: what a real port would be told is written down."""
    reported: list[tuple[int, int]] = []
    real = fcntl.ioctl

    def ioctl(descriptor: int, request: int, *arguments: Any) -> Any:
        if request in (termios.TIOCMBIS, termios.TIOCMBIC):
            reported.append((request, struct.unpack("I", arguments[0])[0]))
            return b""
        return real(descriptor, request, *arguments)

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    OpenDmx(str(cable[1]), 512).close()
    assert (termios.TIOCMBIC, termios.TIOCM_RTS) in reported
    assert (termios.TIOCMBIS, termios.TIOCM_RTS) not in reported
