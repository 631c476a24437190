"""The USB Pro driver against a widget on a pseudo-terminal: pulled out, plugged in, garbage, hanging."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from serial.serialutil import Timeout
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from appliance.outputs.dmx import serial_port
from appliance.outputs.dmx.adapter_wire import AdapterError, AdapterWire
from appliance.outputs.dmx.serial_port import find_device, is_bare_ftdi, is_usb_pro
from appliance.outputs.dmx.usb_pro import usb_pro_wire
from hw_sim.dmx.usb_pro import UsbProWidget
from tests.conftest import ROOT
from tests.outputs.dmx.conftest import config, universe

Until = Callable[[Callable[[], bool]], None]


@pytest.fixture
def widget(tmp_path: Path) -> UsbProWidget:
    """Not plugged in yet."""
    return UsbProWidget(tmp_path / "ttyUSB7")


def wire_to(widget: UsbProWidget, **keys: object) -> AdapterWire:
    return usb_pro_wire(config("usb-pro", device=str(widget.path), **keys))


def test_a_universe_arrives_framed(widget: UsbProWidget, until: Until) -> None:
    with widget:
        wire = wire_to(widget)
        for tick in range(20):
            wire.send_universe(universe(tick), 0.0)
            until(lambda tick=tick: widget.levels == universe(tick))
        until(lambda: wire.sent == 20)
        assert (wire.dropped, wire.is_open, wire.trouble) == (0, True, None)
        wire.close()
    assert {len(packet) for _, packet in widget.universes} == {513}
    assert {packet[0] for _, packet in widget.universes} == {0}
    assert (set(widget.labels), widget.broken) == ({6}, 0)


def test_fewer_channels_make_a_shorter_message(widget: UsbProWidget, until: Until) -> None:
    with widget:
        wire = wire_to(widget, channels=24)
        wire.send_universe(universe(), 0.0)
        until(lambda: widget.levels == universe()[:24])
        wire.close()


def test_what_was_sent_last_arrives_before_the_end(widget: UsbProWidget, until: Until) -> None:
    with widget:
        wire = wire_to(widget)
        wire.send_universe(universe(), 0.0)
        wire.send_universe(bytes(512), 0.0)
        wire.close()
        until(lambda: widget.levels == bytes(512))


def test_a_device_that_is_not_there_is_told_and_found_when_it_comes(
    widget: UsbProWidget, until: Until
) -> None:
    wire = wire_to(widget)
    until(lambda: wire.trouble is not None)
    assert wire.trouble == (
        f"DMX USB Pro {widget.path}, universe 1: it is not plugged in. Its lights do not follow; the show "
        "goes on. It is tried again every 2 seconds: plug it in, or check device and serial in the box file."
    )
    wire.send_universe(universe(1), 0.0)
    wire.send_universe(universe(2), 0.0)
    assert wire.dropped == 1
    with widget:
        until(lambda: widget.levels == universe(2))
        assert wire.trouble is None
        wire.close()


def test_pulled_out_mid_universe_and_back(widget: UsbProWidget, until: Until) -> None:
    widget.plug_in()
    wire = wire_to(widget)
    wire.send_universe(universe(1), 0.0)
    until(lambda: widget.levels == universe(1))
    widget.pull_out()
    wire.send_universe(universe(2), 0.0)
    until(lambda: bool(wire.last_error))
    assert "unplugged" in wire.last_error
    until(lambda: not wire.is_open)
    widget.plug_in()  # a new universe is not needed: it shows the last one by itself
    until(lambda: widget.levels == universe(2))
    assert wire.is_open
    wire.close()
    widget.pull_out()


def test_garbage_from_the_widget_changes_nothing(widget: UsbProWidget, until: Until) -> None:
    with widget:
        wire = wire_to(widget)
        for tick in range(40):
            widget.send_message(bytes(range(256)) * 8 + b"\x7e\x05\xff\xff")
            wire.send_universe(universe(tick), 0.0)
            until(lambda tick=tick: widget.levels == universe(tick))
        until(lambda: wire.sent == 40)
        assert widget.broken == 0
        wire.close()


def test_a_widget_that_hangs_holds_up_nobody_and_comes_back(
    widget: UsbProWidget, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "WRITE_TIMEOUT_S", 2.0)  # a busy machine sends little within 0.25 s
    with widget:
        wire = wire_to(widget)
        wire.send_universe(universe(), 0.0)
        until(lambda: wire.sent == 1)
        widget.hang()
        while not wire.last_error:
            wire.send_universe(universe(100), 0.0)
            time.sleep(0.002)
        assert wire.last_error == "it takes no more data"
        assert wire.dropped > 10  # one write hung all the while: nobody else did
        widget.hang(False)
        wire.send_universe(universe(200), 0.0)
        until(lambda: widget.levels == universe(200))
        wire.close()


def test_a_wire_ends_while_its_widget_hangs(widget: UsbProWidget, until: Until) -> None:
    with widget:
        wire = wire_to(widget)
        widget.hang()
        while not wire.last_error:
            wire.send_universe(universe(), 0.0)
            time.sleep(0.002)
        wire.close()
        until(lambda: not wire.is_open)


def test_another_program_has_it(widget: UsbProWidget, until: Until) -> None:
    with widget:
        first = wire_to(widget)
        first.send_universe(universe(), 0.0)
        until(lambda: first.sent == 1)
        second = wire_to(widget)
        until(lambda: bool(second.last_error))
        assert second.last_error == "another program uses it"
        second.close()
        first.close()


def test_a_machine_that_is_held_up_while_it_writes_blames_no_widget(
    widget: UsbProWidget, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All has left when the driver looks at its clock again, and finds that its time is over."""
    now, real = 0.0, os.write

    def held_up(descriptor: int, data: bytes) -> int:
        nonlocal now
        now += 5.0 if len(taken) == 3 and data[0] == 0x7E else 0.0
        taken.append(real(descriptor, data))
        return taken[-1]

    taken: list[int] = []
    monkeypatch.setattr(Timeout, "TIME", staticmethod(lambda: now))
    monkeypatch.setattr(os, "write", held_up)
    with widget:
        wire = wire_to(widget)
        for tick in range(10):
            wire.send_universe(universe(tick), 0.0)
            until(lambda tick=tick: wire.sent == tick + 1)
        assert now == 5.0
        until(lambda: widget.levels == universe(9))
        assert (wire.last_error, widget.broken) == ("", 0)
        wire.close()


class Adapter:
    """One that fails as often as it is told."""

    def __init__(self, fails: int) -> None:
        self.fails, self.shown, self.closed = fails, [], 0

    def write(self, data: bytes) -> None:
        if self.fails:
            self.fails -= 1
            raise AdapterError("it is slow")
        self.shown.append(data)

    def close(self) -> None:
        self.closed += 1


@pytest.mark.parametrize(("fails", "closed"), [(1, 0), (2, 1)])
def test_an_adapter_is_given_up_when_it_fails_twice(fails: int, closed: int, until: Until) -> None:
    adapter = Adapter(fails)
    wire = AdapterWire("slow", lambda: adapter)
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1)
    assert (adapter.closed, adapter.shown) == (closed, [universe()])
    assert wire.last_error == ("it is slow" if closed else "")
    wire.close()


def test_who_sees_that_a_wire_is_not_open_reads_why(until: Until) -> None:
    adapter = Adapter(2)
    wire = AdapterWire("slow", lambda: adapter)
    adapter.close = lambda: seen.append((wire.is_open, wire.last_error))  # type: ignore[method-assign]
    seen: list[tuple[bool, str]] = []
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1)
    assert seen[0] != (False, "")
    wire.close()


def test_a_driver_s_own_fault_does_not_end_the_thread(until: Until) -> None:
    tries = []

    def open_adapter() -> AdapterWire:
        tries.append(1)
        raise ZeroDivisionError("a bug")

    wire = AdapterWire("faulty", open_adapter)  # type: ignore[arg-type]
    until(lambda: len(tries) >= 2)
    assert wire.last_error == "a bug"
    wire.close()


def port(device: str, product: str, serial_number: str) -> ListPortInfo:
    info = ListPortInfo(device, skip_link_detection=True)
    info.vid, info.pid, info.product, info.serial_number = 0x0403, 0x6001, product, serial_number
    return info


@pytest.fixture
def plugged_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bare cable, a widget, another widget."""
    ports = [
        port("/dev/ttyUSB0", "FT232R USB UART", "A5"),
        port("/dev/ttyUSB1", "DMX USB PRO", "EN1"),
        port("/dev/ttyUSB2", "DMX USB PRO Mk2", "EN2"),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)


@pytest.mark.usefixtures("plugged_in")
def test_an_adapter_is_found_by_what_it_is() -> None:
    assert find_device(None, None, is_usb_pro) == "/dev/ttyUSB1"
    assert find_device(None, None, is_bare_ftdi) == "/dev/ttyUSB0"
    assert find_device(None, "EN2", is_usb_pro) == "/dev/ttyUSB2"
    assert find_device("/dev/dmx", "EN2", is_usb_pro) == "/dev/dmx"
    with pytest.raises(AdapterError, match="no adapter with the USB serial number EN9 is plugged in"):
        find_device(None, "EN9", is_usb_pro)


@pytest.mark.parametrize("product_id", [0x6001, 0x6014, 0x6015])
def test_every_chip_of_a_bare_cable_is_found_by_itself(
    monkeypatch: pytest.MonkeyPatch, product_id: int
) -> None:
    cable, clock = port("/dev/ttyUSB0", "USB UART", "D1"), port("/dev/ttyUSB1", "A clock", "C1")
    cable.pid, clock.pid = product_id, 0x6010  # two channels: no cable for DMX
    monkeypatch.setattr(list_ports, "comports", lambda: [clock, cable])
    assert find_device(None, None, is_bare_ftdi) == "/dev/ttyUSB0"
    rules = (ROOT / "deploy/system/usr/lib/udev/rules.d/60-bunraku.rules").read_text()
    assert f"{product_id:04x}" in rules


def test_an_ultradmx_is_no_bare_cable() -> None:
    ultra = port("/dev/ttyUSB0", "ultraDMX Micro", "6A1")
    assert is_usb_pro(ultra)
    assert not is_bare_ftdi(ultra)


def test_no_adapter_of_the_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(list_ports, "comports", list)
    with pytest.raises(AdapterError, match="no adapter of this kind is plugged in"):
        find_device(None, None, is_usb_pro)
