"""Reads an X11 screen: the stamp that `project --stamp` draws into each picture.

Xlib by ctypes, as xwd reads a screen. Nothing of the projector is used here: the stamp is decoded anew.
"""

from __future__ import annotations

import contextlib
import ctypes
import ctypes.util
import threading
import time
from ctypes import POINTER, Structure, byref, c_char_p, c_int, c_uint, c_ulong, c_void_p
from typing import NamedTuple

import numpy as np

from hw_sim.latency import Floats
from hw_sim.peers import ProbeError

CELL = 8  # pixels
CELLS = 52
_PART = (1 << 10) - 1  # steps of an orientation's part, from -1 to 1
_ALL_PLANES, _Z_PIXMAP = c_ulong(-1), 2
_EVERY_S = 0.001


class Picture(NamedTuple):
    """A picture on the screen: when it was first seen (monotonic seconds), how it shows the held joint.

    joint: its orientation in the world, (4,) w, x, y, z.
    """

    arrived_at: float
    joint: Floats


class _Image(Structure):
    """XImage of Xlib.h up to what is read."""

    _fields_ = (
        *((name, c_int) for name in ("width", "height", "xoffset", "format")),
        ("data", c_void_p),
        *((name, c_int) for name in ("byte_order", "bitmap_unit", "bitmap_bit_order", "bitmap_pad")),
        *((name, c_int) for name in ("depth", "bytes_per_line", "bits_per_pixel")),
    )


class Screen:
    """The screen of the X server that DISPLAY names. Raises ProbeError where there is none."""

    def __init__(self) -> None:
        name = ctypes.util.find_library("X11")
        if name is None:
            raise ProbeError("Xlib is not installed. On Debian: sudo apt-get install -y libx11-6")
        self._x = ctypes.CDLL(name)
        self._x.XOpenDisplay.argtypes, self._x.XOpenDisplay.restype = [c_char_p], c_void_p
        self._x.XGetImage.restype = POINTER(_Image)
        self._x.XDefaultRootWindow.restype = c_ulong
        self._display = c_void_p(self._x.XOpenDisplay(None))
        if not self._display:
            raise ProbeError(
                "No X11 screen to look at. Call it on a desktop with X11, or under a virtual one: "
                "xvfb-run --server-args='-screen 0 1280x720x24' bunraku measure --light"
            )
        self._root = c_ulong(self._x.XDefaultRootWindow(self._display))
        self.size = self._size()

    def cells(self) -> int:
        """The stamp's cells as a number, the first one its highest bit; white is 1."""
        image = self._x.XGetImage(
            self._display,
            self._root,
            *(c_int(0), c_int(self.size[1] - CELL // 2), c_uint(CELL * CELLS), c_uint(1)),
            *(_ALL_PLANES, c_int(_Z_PIXMAP)),
        )
        if not image:
            return 0
        try:
            step = image.contents.bits_per_pixel // 8
            row = ctypes.string_at(image.contents.data, image.contents.bytes_per_line)
        finally:
            self._x.XDestroyImage(image)
        number = 0
        for place in range(CELLS):
            number = number << 1 | (row[(CELL * place + CELL // 2) * step + 1] > 127)  # green
        return number

    def close(self) -> None:
        """Leave the X server."""
        self._x.XCloseDisplay(self._display)

    def _size(self) -> tuple[int, int]:
        root, x, y = c_ulong(), c_int(), c_int()
        width, height, border, depth = c_uint(), c_uint(), c_uint(), c_uint()
        whole = (byref(one) for one in (root, x, y, width, height, border, depth))
        self._x.XGetGeometry(self._display, self._root, *whole)
        if width.value < CELL * CELLS:
            raise ProbeError(f"The screen is {width.value} pixels wide; the stamp needs {CELL * CELLS}.")
        return width.value, height.value


def held_joint(cells: int) -> Floats | None:
    """The orientation (4,) in a stamp's cells; None: no whole stamp."""
    check, word = cells & 15, cells >> 4
    if cells >> 48 != 0b1010 or sum(word >> place & 15 for place in range(0, 44, 4)) % 16 != check:
        return None
    parts = np.array([word >> place & _PART for place in (30, 20, 10, 0)])
    orientation: Floats = 2.0 * parts / _PART - 1.0
    return orientation


class Watcher(threading.Thread):
    """Looks at the screen each millisecond and notes each new picture, until it is stopped."""

    def __init__(self, screen: Screen) -> None:
        super().__init__(daemon=True)
        self.pictures: list[Picture] = []
        self._screen, self._stopped = screen, threading.Event()

    def run(self) -> None:
        """Note the pictures of the screen."""
        before = 0
        while not self._stopped.wait(_EVERY_S):
            cells = self._screen.cells()
            if cells != before:
                before, now = cells, time.monotonic()
                if (joint := held_joint(cells)) is not None:
                    self.pictures.append(Picture(now, joint))

    def stop(self) -> list[Picture]:
        """End it; the pictures that it saw."""
        self._stopped.set()
        with contextlib.suppress(RuntimeError):
            self.join()
        return self.pictures
