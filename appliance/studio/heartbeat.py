"""Heartbeat: a command that has written nothing for a while says that it is still at work."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from textwrap import shorten
from typing import Any

QUIET_S = 8.0
LONGEST = 48  # characters of a line that are repeated


class _Watched:
    """A stream of text that knows when it was last written to, and its last line."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.last_s, self.line = time.monotonic(), ""

    def write(self, text: str) -> int:
        self.last_s = time.monotonic()
        if text.strip():
            self.line = text.strip().splitlines()[-1]
        written: int = self._stream.write(text)
        return written

    def add(self, text: str) -> None:
        """Writes text that does not count as the last line."""
        self._stream.write(text)
        self._stream.flush()
        self.last_s = time.monotonic()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def heartbeat() -> Iterator[None]:
    """Repeats standard error's last line with the seconds since, after every QUIET_S in which it got none.

    A bar on a terminal writes all the time, so nothing is added to it.
    """
    before = sys.stderr
    watched, done = _Watched(before), threading.Event()

    def beat() -> None:
        since = reported = watched.last_s
        while not done.wait(max(0.01, watched.last_s + QUIET_S - time.monotonic())):
            if watched.last_s > reported:
                since = watched.last_s
            if time.monotonic() - watched.last_s >= QUIET_S:
                line = shorten(watched.line, LONGEST, placeholder="").rstrip(" .") or "at work"
                watched.add(f"{line} ... {time.monotonic() - since:.0f} s\n")
                reported = watched.last_s

    thread = threading.Thread(target=beat, name="heartbeat", daemon=True)
    sys.stderr = watched
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
        if sys.stderr is watched:
            sys.stderr = before
