"""Open DMX: a bare FTDI cable whose DMX timing this machine makes itself. Not recommended for shows."""

from __future__ import annotations

import time

import serial

from appliance.outputs.dmx.adapter_wire import AdapterError, AdapterWire
from appliance.outputs.dmx.serial_port import (
    close_port,
    discard_output,
    find_device,
    is_bare_ftdi,
    open_port,
    write,
)
from appliance.show.dmx import DmxConfig

BAUD = 250_000  # ANSI E1.11 section 8: 4 us a bit, 8N2
SLOT_S = 44e-6
BREAK_S = 176e-6  # at least 92 us
MARK_AFTER_BREAK_S = 20e-6  # at least 12 us
CHIP_S = 2e-3  # what the USB chip may take until the first slot leaves it
_START_CODE = b"\0"


class OpenDmx:
    """A cable on an open port."""

    def __init__(self, device: str, channels: int) -> None:
        self._channels = channels
        self._lasts_s = (channels + 1) * SLOT_S + CHIP_S
        # ENTTEC's cable sends while RTS is off; with RTS on it receives, and the lamps get nothing.
        self._port = open_port(device, BAUD, serial.STOPBITS_TWO, rts=False)

    def write(self, data: bytes) -> None:
        """Break, mark, start code, levels; returns when the last slot has left, so that no break cuts it."""
        self._port.break_condition = True
        time.sleep(BREAK_S)
        self._port.break_condition = False
        time.sleep(MARK_AFTER_BREAK_S)
        try:
            write(self._port, _START_CODE + data[: self._channels])
        except AdapterError:
            discard_output(self._port)  # else it would leave after the next break
            raise
        finally:
            time.sleep(self._lasts_s)

    def close(self) -> None:
        close_port(self._port)


def open_dmx_wire(config: DmxConfig) -> AdapterWire:
    """The wire of a box file's entry; a cable has no memory, so the universe is repeated all the time."""

    def open_adapter() -> OpenDmx:
        return OpenDmx(find_device(config.device, config.serial, is_bare_ftdi), config.channels)

    which = config.device or config.serial
    name = f"Open DMX{f' {which}' if which else ''} (not recommended for shows), universe {config.universe}"
    return AdapterWire(name, open_adapter, period_s=1.0 / config.rate)
