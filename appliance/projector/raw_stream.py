"""Raw pictures to another program through a pipe: whole ones, the newest, and never waited for."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable

import numpy as np

from appliance.projector.stream.keying import keyed

_LAST_WRITE_S = 1.0  # seconds, less than the 3 s that systemd and `bunraku play` give the projector


def take_over_stdout() -> int:
    """A descriptor of standard output for pictures; from now on words go to standard error."""
    pictures = os.dup(1)
    os.dup2(2, 1)
    return pictures


class RawStream:
    """Writes pictures, top row first, four bytes a pixel (red, green, blue, unused), from its own thread.

    head: bytes before each, by its size; is_keyed: the fourth byte is alpha, as much as the pixel shines.
    A reader that is slower than the projector gets fewer pictures, each of them whole. is_closed: the reader
    has gone; nothing here raises.
    """

    def __init__(
        self, descriptor: int, head: Callable[[tuple[int, int]], bytes] | None = None, is_keyed: bool = False
    ) -> None:
        self._descriptor, self._head, self._is_keyed = descriptor, head, is_keyed
        self._newest: tuple[bytes, tuple[int, int]] | None = None
        self._is_there, self._is_ending = threading.Event(), False
        self.is_closed = False
        self.written = 0
        self._thread = threading.Thread(target=self._write_pictures, name="raw pictures", daemon=True)
        self._thread.start()

    def offer(self, pixels: bytes, size: tuple[int, int]) -> None:
        """Write this picture (bottom row first, four bytes a pixel) next, instead of one that waits."""
        self._newest = pixels, size
        self._is_there.set()

    def close(self) -> None:
        """End after the picture that is on its way, within a second: a reader that stands still is left."""
        self._is_ending = True
        self._is_there.set()
        self._thread.join(_LAST_WRITE_S)
        if not self._thread.is_alive():
            os.close(self._descriptor)

    def _write_pictures(self) -> None:
        while not self._is_ending:
            self._is_there.wait()
            self._is_there.clear()
            newest, self._newest = self._newest, None
            if newest is None:
                continue
            pixels, (width, height) = newest
            upright = np.frombuffer(pixels, np.uint8).reshape(height, width, 4)[::-1]
            whole = upright.tobytes()
            if self._is_keyed:
                whole = keyed(whole)
            try:
                if self._head is not None:
                    self._write(memoryview(self._head((width, height))))
                self._write(memoryview(whole))
            except OSError:
                self.is_closed = True
                return
            self.written += 1

    def _write(self, rest: memoryview) -> None:
        while len(rest):
            rest = rest[os.write(self._descriptor, rest) :]
