"""Lines for people, written by a thread: a stopped terminal never holds up the tick."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from pathlib import Path
from queue import SimpleQueue

WAITING_LINES = 200
SAID, MOST_SAID = "said", 2000  # the file in the runtime folder, and how many lines it has at least
_LAST_OUTPUT_S = 0.5


class LogWriter:
    """Writes lines to a file descriptor (standard output by default).

    dropped: how many lines found no room because nothing read those before; a later line says so.
    """

    def __init__(self, descriptor: int = 1) -> None:
        self._descriptor = descriptor
        # Its put() takes no lock: the real-time thread would wait for one that another thread holds.
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self.dropped = self._reported = 0
        self._file: Path | None = None
        self._last: deque[str] = deque(maxlen=MOST_SAID)
        self._since_whole = 0  # lines since the file was written as a whole
        self._thread = threading.Thread(target=self._speak, name="speaker", daemon=True)
        self._thread.start()

    def keep_in(self, path: Path) -> None:
        """Keep the last lines in a file too, each with its time (Unix seconds): the page shows them."""
        with contextlib.suppress(OSError):
            path.write_bytes(b"")
        self._file = path

    def say(self, line: str) -> None:
        """Hand over one line; never waits, not even for a lock."""
        if self._lines.qsize() < WAITING_LINES:
            self._lines.put(line)
        else:
            self.dropped += 1

    def close(self) -> None:
        """Let the last lines out, for as long as half a second."""
        self._lines.put(None)
        self._thread.join(_LAST_OUTPUT_S)

    def _speak(self) -> None:
        while (line := self._lines.get()) is not None:
            self._write(line)
            if (dropped := self.dropped) != self._reported and self._lines.empty():
                self._write(
                    f"{dropped - self._reported} lines before this one are missing: nothing took them."
                )
                self._reported = dropped

    def _write(self, line: str) -> None:
        self._keep(f"{time.time():.3f} {line}\n")
        with contextlib.suppress(OSError):  # its reader is gone: the page still gets the line
            os.write(self._descriptor, f"{line}\n".encode(errors="backslashreplace"))

    def _keep(self, line: str) -> None:
        self._last.append(line)
        if self._file is None:
            return
        self._since_whole = (self._since_whole + 1) % MOST_SAID
        said, mode = (line, "ab") if self._since_whole else ("".join(self._last), "wb")
        with contextlib.suppress(OSError), self._file.open(mode) as stream:
            stream.write(said.encode(errors="backslashreplace"))
