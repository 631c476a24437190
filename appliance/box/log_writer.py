"""Lines for people, written by a thread of its own: a stopped terminal never holds up the tick."""

from __future__ import annotations

import contextlib
import os
import threading
from queue import Full, Queue

_WAITING_LINES = 200
_LAST_WORDS_S = 0.5


class Speaker:
    """Writes lines to a file descriptor (standard output by default); what cannot be written is dropped."""

    def __init__(self, descriptor: int = 1) -> None:
        self._descriptor = descriptor
        self._lines: Queue[str | None] = Queue(_WAITING_LINES)
        self._thread = threading.Thread(target=self._speak, name="speaker", daemon=True)
        self._thread.start()

    def say(self, line: str) -> None:
        """Hand over one line; never waits."""
        with contextlib.suppress(Full):
            self._lines.put_nowait(line)

    def close(self) -> None:
        """Let the last lines out, for as long as half a second."""
        with contextlib.suppress(Full):
            self._lines.put_nowait(None)
        self._thread.join(_LAST_WORDS_S)

    def _speak(self) -> None:
        while (line := self._lines.get()) is not None:
            try:
                os.write(self._descriptor, f"{line}\n".encode(errors="backslashreplace"))
            except OSError:
                return  # nobody listens any more: the show goes on
