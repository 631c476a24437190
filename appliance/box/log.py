"""The log of a process: standard `logging`, written by a thread. A stopped terminal never holds up the tick.

Modules log to `logging.getLogger(__name__)`: info for what happens in a usual show, warning where the show
goes on with less than it should have, error where a process cannot do its work.
"""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue

WAITING_LINES = 200
SAID, MOST_SAID = "said", 2000  # the file in the runtime folder, and how many lines it has at least
OURS = "appliance"  # the logger above all of the product's own
LINES, PERIOD_S = 10, 60.0
_ANSWERED = "aiohttp.http_exceptions"  # what is no HTTP got its 400
_LAST_OUTPUT_S = 0.5
# syslog(3); systemd's journal takes a line's priority from its beginning (sd-daemon(3)).
INFO_PRIORITY = 6
_PRIORITIES = {
    logging.CRITICAL: 2,
    logging.ERROR: 3,
    logging.WARNING: 4,
    logging.INFO: INFO_PRIORITY,
    logging.DEBUG: 7,
}


class Trouble(str):
    """A sentence about what the show goes on without: the log has it as a warning."""

    __slots__ = ()


class LogWriter(logging.Handler):
    """Writes records to a file descriptor (standard output by default), and their priorities to journald.

    dropped: how many records found no room because nothing read those before; a later line says so.
    """

    def __init__(self, descriptor: int = 1) -> None:
        super().__init__()
        self._descriptor = descriptor
        self._names_priorities = is_journal(descriptor)
        # Its put() takes no lock: the real-time thread would wait for one that another thread holds.
        self._records: SimpleQueue[tuple[str, int] | None] = SimpleQueue()
        self.dropped = self._reported = 0
        self._file: Path | None = None
        self._in_file = 0  # records
        self._is_closed = False
        self._thread = threading.Thread(target=self._write_all, name="log writer", daemon=True)
        self._thread.start()

    def handle(self, record: logging.LogRecord) -> bool:
        """As logging.Handler's, but it takes no lock."""
        try:
            if passes := bool(self.filter(record)):
                self.emit(record)
        except Exception:  # as logging does: reported on standard error
            self.handleError(record)
            return False
        return passes

    def keep_in(self, path: Path) -> None:
        """Keep the last records in a file too, for the page; each is a line: Unix seconds, priority, text."""
        with contextlib.suppress(OSError):
            path.write_bytes(b"")
        self._file = path

    def emit(self, record: logging.LogRecord) -> None:
        """Hand over one record; never waits, not even for a lock."""
        if self._records.qsize() < WAITING_LINES:
            self._records.put((self.format(record), record.levelno))
        else:
            self.dropped += 1

    def close(self) -> None:
        """Let the last records out, for as long as half a second; `logging` closes it again at the end."""
        if not self._is_closed:
            self._is_closed = True
            self._records.put(None)
            self._thread.join(_LAST_OUTPUT_S)
        super().close()

    def _write_all(self) -> None:
        while (record := self._records.get()) is not None:
            self._write(*record)
            if (dropped := self.dropped) != self._reported and self._records.empty():
                missing = dropped - self._reported
                self._write(
                    f"{missing} lines before this one are missing: nothing took them.", logging.WARNING
                )
                self._reported = dropped

    def _write(self, text: str, level: int) -> None:
        priority = _PRIORITIES.get(level, INFO_PRIORITY)
        self._keep(f"{time.time():.3f} {priority} {' '.join(text.splitlines())}\n")
        if self._names_priorities:
            text = "\n".join(f"<{priority}>{line}" for line in text.split("\n"))
        with contextlib.suppress(OSError):  # its reader is gone: the page still gets the line
            os.write(self._descriptor, f"{text}\n".encode(errors="backslashreplace"))

    def _keep(self, line: str) -> None:
        if self._file is None:
            return
        with contextlib.suppress(OSError):
            if self._in_file >= 2 * MOST_SAID:
                self._in_file = MOST_SAID
                last = self._file.read_bytes().splitlines(keepends=True)[-MOST_SAID:]
                self._file.write_bytes(b"".join(last))
            with self._file.open("ab") as stream:
                stream.write(line.encode(errors="backslashreplace"))
            self._in_file += 1


class LibraryLimit(logging.Filter):
    """Passes every record of the product, and LINES of libraries in PERIOD_S, which strangers may provoke.

    The next record of a library then says how many were left out. The traceback of a request that is no HTTP
    is dropped: it names nothing that anybody could mend.
    """

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._monotonic = monotonic
        self._since, self._count = monotonic(), 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether this record is written."""
        if record.name.startswith(OURS):
            return True
        error = record.exc_info[1] if record.exc_info else None
        if record.levelno < logging.WARNING or type(error).__module__ == _ANSWERED:
            return False
        now = self._monotonic()
        message = record.getMessage()
        if now - self._since >= PERIOD_S:
            if (left_out := self._count - LINES) > 0:
                message = f"{message} ({left_out} messages before this one were left out.)"
            self._since, self._count = now, 0
        record.msg, record.args = f"{record.name}: {message}", None
        self._count += 1
        return self._count <= LINES


@contextlib.contextmanager
def process_log(descriptor: int = 1) -> Iterator[LogWriter]:
    """A context in which all records of this process go to its standard output, without waiting for it."""
    writer = LogWriter(descriptor)
    writer.addFilter(LibraryLimit())
    root = logging.getLogger()
    root.addHandler(writer)
    logging.getLogger(OURS).setLevel(logging.INFO)
    try:
        yield writer
    finally:
        root.removeHandler(writer)
        writer.close()


def log_sentence(logger: logging.Logger, sentence: str) -> None:
    """Log a sentence as its kind says."""
    logger.log(logging.WARNING if isinstance(sentence, Trouble) else logging.INFO, sentence)


def is_journal(descriptor: int) -> bool:
    """Whether systemd's journal reads it (JOURNAL_STREAM, systemd.exec(5))."""
    device, _, inode = os.environ.get("JOURNAL_STREAM", "").partition(":")
    with contextlib.suppress(OSError):
        opened = os.fstat(descriptor)
        return (device, inode) == (str(opened.st_dev), str(opened.st_ino))
    return False
