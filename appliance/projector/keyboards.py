"""Keyboards of a box without a desktop, read from the kernel (evdev), including those plugged in later.

The SDL library in Python packages is built without udev, so it finds no keyboard on KMS/DRM.
"""

from __future__ import annotations

import contextlib
import fcntl
import math
import os
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

DEVICES = Path("/dev/input")
# linux/input.h, struct input_event: seconds, microseconds, type, code, value.
_EVENT = struct.Struct("@llHHi")
_EV_KEY = 0x01
_EVIOCGBIT_KEY = 2 << 30 | 96 << 16 | ord("E") << 8 | 0x20 + _EV_KEY  # which keys it has, 96 bytes of bits
_RELEASED = 0
_SHIFTS = (42, 54)
# linux/input-event-codes.h: by their places on a US keyboard.
_NAMES = (
    {1: "Escape", 15: "Tab", 103: "Up", 105: "Left", 106: "Right", 108: "Down"}
    | {2: "1", 3: "2", 4: "3", 5: "4", 12: "-", 13: "=", 74: "Keypad -", 78: "Keypad +"}
    | {16: "Q", 19: "R", 20: "T", 23: "I", 33: "F", 34: "G", 35: "H", 46: "C", 50: "M"}
)
_REFUSED_S = 0.5  # udev grants access to a new device some time after the kernel has made it
_SETTLED_S = 1.0  # after a change, look once more: a folder's time stamp is as coarse as the kernel's tick
_MOST_EVENTS = 64  # at once, from one keyboard


@dataclass(frozen=True)
class Key:
    """A key that was pressed: its name on the keyboard, and whether shift was held."""

    name: str
    shift: bool = False


class Keyboards:
    """All keyboards in a folder of devices. Nothing here raises or blocks.

    is_refused: whether there are devices and this user may read none of them.
    """

    def __init__(self, devices: Path = DEVICES, *, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._devices, self._now = devices, monotonic
        self._open: dict[Path, int] = {}
        self._others: set[Path] = set()  # no keyboards, as the folder is now
        self._changed: int | None = None
        self._settled_at = self._again_at = math.inf  # when to look although nothing changed
        self._shifts: set[tuple[int, int]] = set()
        self.is_refused = False
        self._open_new()

    def pressed(self) -> Iterator[Key]:
        """Keys that were pressed, or repeat, since the last time."""
        self._open_new()
        for path, descriptor in list(self._open.items()):
            try:
                received = os.read(descriptor, _MOST_EVENTS * _EVENT.size)
            except BlockingIOError:
                continue
            except OSError:
                received = b""
            if not received:  # unplugged
                self._forget(path)
                continue
            whole = len(received) - len(received) % _EVENT.size
            for _, _, kind, code, value in _EVENT.iter_unpack(received[:whole]):
                if kind == _EV_KEY:
                    yield from self._key(descriptor, code, value)

    def close(self) -> None:
        for path in list(self._open):
            self._forget(path)

    def _key(self, descriptor: int, code: int, value: int) -> Iterator[Key]:
        if code in _SHIFTS:
            held = (descriptor, code)
            self._shifts = self._shifts - {held} if value == _RELEASED else self._shifts | {held}
        elif value != _RELEASED and code in _NAMES:
            yield Key(_NAMES[code], bool(self._shifts))

    def _open_new(self) -> None:
        """Open devices plugged in since the folder last changed, and those refused so far."""
        now = self._now()
        try:
            changed = self._devices.stat().st_mtime_ns
        except OSError:
            return
        if changed != self._changed:
            self._changed, self._settled_at = changed, now + _SETTLED_S
            self._others.clear()
        elif now < self._again_at:
            return
        if now >= self._settled_at:
            self._settled_at = math.inf
            self._others.clear()
        refused = 0
        for path in self._devices.glob("event*"):
            if path not in self._open and path not in self._others:
                try:
                    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
                except OSError:
                    refused += 1
                    continue
                if is_keyboard(descriptor):
                    self._open[path] = descriptor
                else:
                    os.close(descriptor)
                    self._others.add(path)
        self._again_at = min(self._settled_at, now + _REFUSED_S if refused else math.inf)
        self.is_refused = refused > 0 and not self._open

    def _forget(self, path: Path) -> None:
        descriptor = self._open.pop(path)
        self._shifts = {held for held in self._shifts if held[0] != descriptor}
        self._changed = None  # what has this name next is another device
        with contextlib.suppress(OSError):
            os.close(descriptor)


def is_keyboard(descriptor: int) -> bool:
    """Whether a device has the projector's keys; mice and power buttons do not."""
    try:
        bits = fcntl.ioctl(descriptor, _EVIOCGBIT_KEY, bytes(96))
    except OSError:
        return False
    return all(bits[code // 8] >> code % 8 & 1 for code in (*_SHIFTS, 16, 46, 105))
