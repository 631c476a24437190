"""anyma uDMX: one universe as a USB control transfer."""

from __future__ import annotations

import contextlib
from typing import Any

import usb.core
import usb.util

from appliance.outputs.dmx.adapter_wire import AdapterError, AdapterWire
from appliance.show.dmx import DmxConfig

VENDOR, PRODUCT = 0x16C0, 0x05DC  # shared by many makers: only the product name identifies it
PRODUCT_WORD = "uDMX"
_TO_DEVICE = 0x40  # vendor request to the device
_SET_CHANNEL_RANGE = 2
TIMEOUT_MS = 500  # as OLA waits; a full universe takes about 60 ms on its slow USB


class Udmx:
    """A plugged-in uDMX, found by pyusb; `backend` is pyusb's own, None for the machine's libusb."""

    def __init__(self, number: str | None, channels: int, backend: Any = None) -> None:
        self._channels = channels
        self._shown: bytes | None = None
        self._device = _find(number, backend)

    def write(self, data: bytes) -> None:
        """Write the changed channels as one range; without changes all of them, in case it forgot."""
        first, end = _changed(self._shown, data[: self._channels])
        taken = self._device.ctrl_transfer(
            _TO_DEVICE, _SET_CHANNEL_RANGE, end - first, first, data[first:end], TIMEOUT_MS
        )
        if taken != end - first:
            raise AdapterError(f"it took {taken} of {end - first} channels")
        self._shown = data[: self._channels]

    def close(self) -> None:
        with contextlib.suppress(usb.core.USBError):
            usb.util.dispose_resources(self._device)


def _find(number: str | None, backend: Any) -> Any:
    """The uDMX with this serial number. Raises AdapterError with what to do."""
    try:
        devices = list(usb.core.find(find_all=True, idVendor=VENDOR, idProduct=PRODUCT, backend=backend))
    except usb.core.NoBackendError:
        raise AdapterError("libusb is missing; on Debian: sudo apt-get install libusb-1.0-0") from None
    unreadable = 0
    for device in devices:
        try:
            if device.product == PRODUCT_WORD and number in (None, device.serial_number):
                return device
        except (usb.core.USBError, ValueError):  # pyusb's errors for a device that this user may not read
            unreadable += 1
    if unreadable:
        raise AdapterError("this user may not open it: give the USB device 16c0:05dc to the user (udev rule)")
    raise AdapterError(f"no uDMX{f' with the USB serial number {number}' if number else ''} is plugged in")


def _changed(shown: bytes | None, data: bytes) -> tuple[int, int]:
    """The range of channels that differ, from the first to one past the last."""
    if shown is None or shown == data:
        return 0, len(data)
    differing = [place for place in range(len(data)) if shown[place] != data[place]]
    return differing[0], differing[-1] + 1


def udmx_wire(config: DmxConfig, backend: Any = None) -> AdapterWire:
    """The wire of a box file's entry."""
    which = f" {config.serial}" if config.serial else ""
    return AdapterWire(
        f"uDMX{which}, universe {config.universe}", lambda: Udmx(config.serial, config.channels, backend)
    )
