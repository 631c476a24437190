"""A uDMX as a backend of pyusb: what libusb would give when one is plugged in, and when it is pulled out."""

from __future__ import annotations

import array
import errno
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import usb.backend
import usb.core

VENDOR, PRODUCT = 0x16C0, 0x05DC
CHANNELS = 512
_STRINGS = {0: b"\x09\x04", 1: "www.anyma.ch".encode("utf-16-le")}  # 0: languages, English (USA)
_GET_DESCRIPTOR, _STRING = 6, 3
_SET_CHANNEL_RANGE = 2


@dataclass
class Plug:
    """One device on the bus."""

    product: str
    serial_number: str | None
    address: int


class UdmxBackend(usb.backend.IBackend):  # type: ignore[misc]
    """The interface that pyusb calls. `levels`: the output to the lights; `ranges`: each transfer as (first,
    count).

    pull_out_after: the device disappears after this many more transfers, in the middle of a universe.
    """

    def __init__(self, product: str = "uDMX", serial_number: str | None = "ilLUTZminator001") -> None:
        self.levels = bytearray(CHANNELS)
        self.ranges: list[tuple[int, int]] = []
        self.pull_out_after: int | None = None
        self.is_readable = True  # False: the user has no rights to the device
        self.handles = 0  # opened and not closed
        self.takes_ms = 60  # a transfer of levels
        self._plug = Plug(product, serial_number, 1)
        self._is_in = True

    def plug_in(self) -> None:
        """The same device again, as Linux sees it: under a new address."""
        self._plug = Plug(self._plug.product, self._plug.serial_number, self._plug.address + 1)
        self._is_in = True

    def pull_out(self) -> None:
        """It forgets its levels; an open handle gets ENODEV."""
        self._is_in = False
        self.levels = bytearray(CHANNELS)

    def enumerate_devices(self) -> list[Plug]:
        """Devices on the bus."""
        return [self._plug] if self._is_in else []

    def get_device_descriptor(self, device: Plug) -> SimpleNamespace:
        """USB 2.0, table 9-8, and where it is plugged in."""
        return SimpleNamespace(
            bLength=18,
            bDescriptorType=1,
            bcdUSB=0x0110,
            bDeviceClass=0xFF,
            bDeviceSubClass=0,
            bDeviceProtocol=0,
            bMaxPacketSize0=8,
            idVendor=VENDOR,
            idProduct=PRODUCT,
            bcdDevice=0x0102,
            iManufacturer=1,
            iProduct=2,
            iSerialNumber=0 if device.serial_number is None else 3,
            bNumConfigurations=1,
            address=device.address,
            bus=1,
            port_number=1,
            port_numbers=(1,),
            speed=1,
        )

    def open_device(self, device: Plug) -> Plug:
        """A handle."""
        self._require(device)
        if not self.is_readable:
            raise usb.core.USBError("Access denied (insufficient permissions)", -3, errno.EACCES)
        self.handles += 1
        return device

    def close_device(self, handle: Plug) -> None:
        """Give the handle back."""
        self.handles -= 1

    def ctrl_transfer(
        self, handle: Plug, request_type: int, request: int, value: int, index: int, data: Any, timeout: int
    ) -> int:
        """Strings (standard request) and levels (vendor requests); octets that were transferred."""
        self._require(handle)
        if (request_type, request) == (0x80, _GET_DESCRIPTOR) and value >> 8 == _STRING:
            return self._descriptor(handle, value & 0xFF, data)
        if (request_type, request) != (0x40, _SET_CHANNEL_RANGE):
            raise usb.core.USBError("Pipe error", -9, errno.EPIPE)
        if timeout < self.takes_ms:
            raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
        return self._take(handle, value, index, bytes(data))

    def _require(self, device: Plug) -> None:
        if not self._is_in or device is not self._plug:
            raise usb.core.USBError("No such device (it may have been disconnected)", -4, errno.ENODEV)

    def _descriptor(self, device: Plug, number: int, data: array.array[int]) -> int:
        words = {2: device.product, 3: device.serial_number or ""}
        content = words[number].encode("utf-16-le") if number in words else _STRINGS[number]
        descriptor = bytes((len(content) + 2, _STRING)) + content
        length = min(len(descriptor), len(data))
        data[:length] = array.array("B", descriptor[:length])
        return length

    def _take(self, device: Plug, count: int, first: int, levels: bytes) -> int:
        if count != len(levels) or first + count > CHANNELS:
            raise usb.core.USBError("Pipe error", -9, errno.EPIPE)
        half = count // 2 if self.pull_out_after == 0 else count
        self.levels[first : first + half] = levels[:half]
        if self.pull_out_after is not None:
            self.pull_out_after -= 1
            if self.pull_out_after < 0:
                self.pull_out_after = None
                self.pull_out()
                self._require(device)
        self.ranges.append((first, count))
        return count
