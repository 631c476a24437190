"""ENTTEC DMX USB Pro and compatibles: one universe as a framed message to the widget."""

from __future__ import annotations

from appliance.outputs.dmx.adapter_wire import AdapterWire
from appliance.outputs.dmx.serial_port import close_port, find_device, is_usb_pro, open_port, write
from appliance.show.dmx import DmxConfig

BAUD = 57600  # over USB the speed means nothing; Linux wants one
_SEND_DMX = 6  # 'Output Only Send DMX Packet Request', DMX USB Pro API 1.44
_START, _END = 0x7E, b"\xe7"
_START_CODE = 0


class UsbPro:
    """A widget on an open port."""

    def __init__(self, device: str, channels: int) -> None:
        self._channels = channels
        length = channels + 1
        self._head = bytes((_START, _SEND_DMX, length & 0xFF, length >> 8, _START_CODE))
        self._port = open_port(device, BAUD)

    def write(self, data: bytes) -> None:
        """Write one universe; input from the widget (received DMX, garbage) is discarded."""
        write(self._port, self._head + data[: self._channels] + _END)

    def close(self) -> None:
        close_port(self._port)


def usb_pro_wire(config: DmxConfig) -> AdapterWire:
    """The wire of a box file's entry."""

    def open_adapter() -> UsbPro:
        return UsbPro(find_device(config.device, config.serial, is_usb_pro), config.channels)

    which = config.device or config.serial
    return AdapterWire(f"DMX USB Pro{f' {which}' if which else ''}, universe {config.universe}", open_adapter)
