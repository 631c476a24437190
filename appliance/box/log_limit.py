"""Library logs go to standard error at a limited rate: strangers may provoke them."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

LINES, PERIOD_S = 10, 60.0
_ANSWERED = "aiohttp.http_exceptions"  # what is no HTTP got its 400


class LogLimit(logging.Filter):
    """Lets LINES records through in PERIOD_S; the first one after that says how many were left out.

    Requests that are no HTTP are none of them: their traceback says nothing that anybody could mend.
    """

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._monotonic = monotonic
        self._since, self._count = monotonic(), 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether this record is written."""
        error = record.exc_info[1] if record.exc_info else None
        if type(error).__module__ == _ANSWERED:
            return False
        now = self._monotonic()
        if now - self._since >= PERIOD_S:
            if (left_out := self._count - LINES) > 0:
                record.msg = f"{record.getMessage()} ({left_out} messages before this one were left out.)"
                record.args = None
            self._since, self._count = now, 0
        self._count += 1
        return self._count <= LINES


def limit_log() -> None:
    """From now on, for the whole process."""
    handler = logging.StreamHandler()
    handler.addFilter(LogLimit())
    logging.basicConfig(level=logging.WARNING, format="%(name)s: %(message)s", handlers=[handler])
