"""The serial device of a DMX adapter: by its path, by its USB serial number, or the first of its kind."""

from __future__ import annotations

import contextlib
import termios
import time
from collections.abc import Callable

import serial
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from appliance.outputs.dmx.adapter_wire import AdapterError

WRITE_TIMEOUT_S = 0.25  # ten universes: an adapter that takes nothing for this long hangs
FTDI, FTDI_CHIPS = 0x0403, (0x6001, 0x6014, 0x6015)  # FT232R, FT232H, FT230X and FT231X
_PRO_WORDS = ("DMX USB PRO", "ULTRADMX")


def find_device(device: str | None, number: str | None, is_kind: Callable[[ListPortInfo], bool]) -> str:
    """The path of the adapter. Raises AdapterError where no such adapter is plugged in."""
    if device is not None:
        return device
    if number is None:
        found = adapters_here(is_kind)
    else:
        found = [port for port in list_ports.comports() if port.serial_number == number]
    if found:
        return str(found[0].device)
    wanted = f"with the USB serial number {number}" if number is not None else "of this kind"
    raise AdapterError(f"no adapter {wanted} is plugged in")


def adapters_here(is_kind: Callable[[ListPortInfo], bool]) -> list[ListPortInfo]:
    """All adapters of a kind that are plugged in; without a serial number the first one is taken."""
    return [port for port in sorted(list_ports.comports()) if is_kind(port)]


def is_usb_pro(port: ListPortInfo) -> bool:
    """Whether it is a DMX USB Pro (ENTTEC) or an ultraDMX (DMXking), by its product name."""
    return any(word in (port.product or "").upper() for word in _PRO_WORDS)


def is_bare_ftdi(port: ListPortInfo) -> bool:
    """Whether it is an FTDI chip without a controller behind it, as far as USB tells."""
    return port.vid == FTDI and port.pid in FTDI_CHIPS and not is_usb_pro(port)


def open_port(
    device: str, baud: int, stopbits: float = serial.STOPBITS_ONE, rts: bool = True
) -> serial.Serial:
    """Open the device exclusively; `rts`: its line 'request to send'. Raises OSError."""
    port = serial.Serial(
        None, baud, stopbits=stopbits, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True
    )
    port.port, port.rts = device, rts
    try:
        port.open()
        return port
    except termios.error as error:  # not a subclass of OSError
        raise OSError(*error.args) from None


def write(port: serial.Serial, data: bytes) -> None:
    """Write all of it and discard input. Raises AdapterError."""
    try:
        port.reset_input_buffer()
        port.write(data)
    except serial.SerialTimeoutException:
        raise AdapterError("it takes no more data") from None
    except (OSError, termios.error):
        raise AdapterError("it was unplugged") from None


def discard_output(port: serial.Serial) -> None:
    """Discard output that the device has not taken yet. Never raises."""
    with contextlib.suppress(OSError, termios.error):
        port.reset_output_buffer()


def close_port(port: serial.Serial) -> None:
    """Close after the last universe has left; output for a hung adapter is discarded.

    Linux would wait 30 s for it.
    """
    give_up = time.monotonic() + WRITE_TIMEOUT_S
    with contextlib.suppress(OSError, termios.error):
        while port.out_waiting and time.monotonic() < give_up:
            time.sleep(0.002)
        if port.out_waiting:
            port.reset_output_buffer()
    with contextlib.suppress(OSError, termios.error):
        port.close()
