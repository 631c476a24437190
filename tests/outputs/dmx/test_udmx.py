"""uDMX through pyusb, against a backend that is the device: pulled out mid-universe, back, unreadable."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import usb.core

from appliance.outputs.dmx.udmx import udmx_wire
from hw_sim.dmx.udmx import UdmxBackend
from tests.outputs.dmx.conftest import config, universe

Until = Callable[[Callable[[], bool]], None]


def test_a_universe_arrives(until: Until) -> None:
    bus = UdmxBackend()
    wire = udmx_wire(config("udmx"), bus)
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1)
    assert bus.levels == universe()
    assert bus.ranges == [(0, 512)]
    wire.close()
    assert bus.handles == 0


def test_only_what_changed_travels(until: Until) -> None:
    bus = UdmxBackend()
    wire = udmx_wire(config("udmx"), bus)
    levels = bytearray(512)
    for tick, (first, end) in enumerate([(0, 512), (10, 20), (511, 512), (0, 1)], start=1):
        levels[first:end] = bytes([100 + tick]) * (end - first)
        wire.send_universe(levels, 0.0)
        until(lambda tick=tick: wire.sent == tick)
        assert bus.levels == levels
    assert bus.ranges == [(0, 512), (10, 10), (511, 1), (0, 1)]
    wire.send_universe(levels, 0.0)  # a keep-alive says everything, in case it forgot
    until(lambda: wire.sent == 5)
    assert bus.ranges[-1] == (0, 512)
    wire.close()


def test_an_adapter_on_a_busy_hub_gets_its_time(until: Until) -> None:
    bus = UdmxBackend()
    bus.takes_ms = 400
    wire = udmx_wire(config("udmx"), bus)
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1 or wire.last_error != "")
    assert bus.levels == universe()
    wire.close()


def test_fewer_channels(until: Until) -> None:
    bus = UdmxBackend()
    wire = udmx_wire(config("udmx", channels=24), bus)
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1)
    assert bus.levels == universe()[:24] + bytes(488)
    wire.close()


def test_pulled_out_mid_universe_and_back(until: Until) -> None:
    bus = UdmxBackend()
    wire = udmx_wire(config("udmx"), bus)
    wire.send_universe(universe(1), 0.0)
    until(lambda: wire.sent == 1)
    bus.pull_out_after = 0
    wire.send_universe(universe(2), 0.0)
    until(lambda: not wire.is_open)
    until(lambda: "no uDMX is plugged in" in wire.last_error)
    assert wire.trouble is not None
    assert wire.trouble.startswith(
        "uDMX, universe 1: no uDMX is plugged in. Its lights do not follow; the show"
    )
    bus.plug_in()
    until(lambda: bus.levels == universe(2))
    assert bus.ranges[-1] == (0, 512)
    assert wire.trouble is None
    wire.close()
    assert bus.handles == 0


def test_another_device_with_the_shared_numbers_is_left_alone(until: Until) -> None:
    bus = UdmxBackend(product="USB thermometer")
    wire = udmx_wire(config("udmx"), bus)
    until(lambda: bool(wire.last_error))
    assert "no uDMX is plugged in" in wire.last_error
    wire.close()
    assert not bus.ranges


def test_by_serial_number(until: Until) -> None:
    bus = UdmxBackend(serial_number="left")
    wire = udmx_wire(config("udmx", serial="right"), bus)
    until(lambda: bool(wire.last_error))
    assert "no uDMX with the USB serial number right is plugged in" in wire.last_error
    wire.close()
    wire = udmx_wire(config("udmx", serial="left"), bus)
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1)
    wire.close()


def test_no_right_to_the_device(until: Until) -> None:
    bus = UdmxBackend()
    bus.is_readable = False
    wire = udmx_wire(config("udmx"), bus)
    until(lambda: bool(wire.last_error))
    assert "this user may not open it" in wire.last_error
    bus.is_readable = True
    wire.send_universe(universe(), 0.0)
    until(lambda: wire.sent == 1)
    wire.close()


def test_no_libusb(monkeypatch: pytest.MonkeyPatch, until: Until) -> None:
    def find(**_: object) -> None:
        raise usb.core.NoBackendError("No backend available")

    monkeypatch.setattr(usb.core, "find", find)
    wire = udmx_wire(config("udmx"))
    until(lambda: bool(wire.last_error))
    assert "libusb is missing" in wire.last_error
    wire.close()
