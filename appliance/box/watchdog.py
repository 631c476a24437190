"""The watchdog within a process: a thread that sees whether work without a timeout still goes on."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

LOOK_S = 0.5
_STOOD_STILL_S = (
    2.0  # between two checks: this process itself was suspended, by Ctrl-Z or by a machine asleep
)
_LAST_OUTPUT_S = 0.5


class Patience:
    """Whether the work hangs. Times are monotonic seconds; before its first sign it does not."""

    def __init__(self, patience_s: float) -> None:
        self.patience_s = patience_s
        self._since: float | None = None
        self._looked_at = 0.0

    def note_sign(self, now: float) -> None:
        """Note that the work goes on."""
        self._since = now

    def is_over(self, now: float, is_preparing: bool) -> bool:
        """Call it often. Neither preparing a show nor a pause of the whole process counts as hanging."""
        stood_still = now - self._looked_at > _STOOD_STILL_S
        self._looked_at = now
        if self._since is None:
            return False
        if is_preparing or stood_still:
            self._since = now
        return now - self._since >= self.patience_s


@contextmanager
def guarded(
    patience: Patience,
    is_preparing: Callable[[], bool],
    give_up: Callable[[], None],
    monotonic: Callable[[], float] = time.monotonic,
    is_well: Callable[[float], None] = lambda now: None,
) -> Iterator[None]:
    """Run a thread that calls `is_well` while the work gives signs, and `give_up` once it hangs."""
    is_done = threading.Event()

    def watch() -> None:
        while not is_done.wait(LOOK_S):
            now = monotonic()
            if patience.is_over(now, is_preparing()):
                give_up()
                return
            is_well(now)

    thread = threading.Thread(target=watch, name="watchdog", daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_done.set()
        thread.join()


def end_process(message: str, status: int) -> NoReturn:
    """Report why, and end at once: a thread that waits for a device receives no signal either."""
    # A stopped terminal must not block this.
    saying = threading.Thread(target=_say, args=(message,), daemon=True)
    saying.start()
    saying.join(_LAST_OUTPUT_S)
    os._exit(status)


def _say(message: str) -> None:
    print(f"bunraku: {message}", file=sys.stderr, flush=True)
    sys.stdout.flush()
