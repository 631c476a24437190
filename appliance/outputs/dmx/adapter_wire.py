"""A universe on a USB adapter: a thread writes the newest levels and reopens the device."""

from __future__ import annotations

import errno
import threading
import time
from collections.abc import Callable
from typing import Protocol

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 2.0
ENDS_WITHIN_S = 1.0  # the last universe leaves within this, unless the device hangs
_MEANINGS = {
    errno.ENOENT: "it is not plugged in",
    errno.ENODEV: "it is not plugged in",
    errno.ENXIO: "it is not plugged in",
    errno.EIO: "it was unplugged",
    errno.EACCES: "this user may not open it: add the user to the group dialout, or give the device to it",
    errno.EPERM: "this user may not open it: add the user to the group dialout, or give the device to it",
    errno.EBUSY: "another program uses it",
    errno.EAGAIN: "another program uses it",
}


class AdapterError(OSError):
    """An adapter that does not work; the message is for people."""


class Adapter(Protocol):
    """An adapter that is plugged in."""

    def write(self, data: bytes) -> None:
        """Write one universe, 512 levels. May take as long as DMX takes. Raises OSError when it is gone."""

    def close(self) -> None:
        """Release the device without waiting for output that it has not taken. Never raises."""


class AdapterWire:
    """Newest wins: a universe that has not left when the next comes is dropped and counted.

    period_s: how often unchanged levels must be repeated; None: never.
    """

    def __init__(self, name: str, open_adapter: Callable[[], Adapter], period_s: float | None = None) -> None:
        self.name = name
        self.sent = 0
        self.dropped = 0
        self.last_error = ""
        self.is_open = False
        self._open_adapter = open_adapter
        self._period_s = period_s
        self._newest: bytes | None = None  # waits to leave
        self._last: bytes | None = None  # what the adapter has to show
        self._closing = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str | None:
        """Says what happened, what the audience sees, what to do."""
        if self.is_open or not self.last_error:
            return None
        return (
            f"{self.name}: {self.last_error}. Its lights do not follow; the show goes on. "
            "It is tried again every 2 seconds: plug it in, or check device and serial in the box file."
        )

    @property
    def remark(self) -> str:
        """Nothing: a cable works or does not."""
        return ""

    def send_universe(self, levels: bytes | bytearray, now: float) -> None:
        """Hand one universe to the thread; never waits for the device."""
        with self._changed:
            if self._newest is not None:
                self.dropped += 1
            self._newest = bytes(levels)
            self._changed.notify()

    def close(self) -> None:
        """Write the last universe and release the device; a device that hangs is abandoned."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(ENDS_WITHIN_S)

    def _run(self) -> None:
        pause_s = FIRST_PAUSE_S
        while True:
            before = self.sent
            try:
                self._feed(self._open_adapter())
            except Exception as error:  # drivers raise anything: the lights return with the device
                self._failed(error)
            self.is_open = False  # after last_error is set
            if self._closing:
                self.dropped += self._newest is not None
                return
            pause_s = FIRST_PAUSE_S if self.sent > before else min(2 * pause_s, LONGEST_PAUSE_S)
            self._wait(pause_s)

    def _feed(self, adapter: Adapter) -> None:
        """Write until the wire is closed and all has left. Raises what the adapter raises."""
        self.is_open = True
        due = time.monotonic()
        try:
            while (data := self._next(due)) is not None:
                _write_twice(adapter, data)
                self.sent += 1
                due = max(due + (self._period_s or 0.0), time.monotonic())
        finally:
            adapter.close()

    def _next(self, due: float) -> bytes | None:
        """Wait for the next universe to write; None once the wire is closed and nothing is left."""
        with self._changed:
            if self._period_s is not None:
                self._changed.wait_for(lambda: self._closing, timeout=max(0.0, due - time.monotonic()))
            while self._newest is None and not self._closing:
                if self._period_s is not None and self._last is not None:
                    return self._last
                self._changed.wait()
            data, self._newest = self._newest, None
            self._last = data or self._last
            return data

    def _wait(self, pause_s: float) -> None:
        """Wait before the next try; a returning adapter gets the last universe at once."""
        with self._changed:
            self._changed.wait_for(lambda: self._closing, timeout=pause_s)
            self._newest = self._newest or self._last

    def _failed(self, error: Exception) -> None:
        number = error.errno if isinstance(error, OSError) else None
        self.last_error = _MEANINGS.get(number or 0, str(error))


def _write_twice(adapter: Adapter, data: bytes) -> None:
    """Write, with one retry: drivers report a failure when this process was held up."""
    try:
        adapter.write(data)
    except OSError:
        adapter.write(data)
