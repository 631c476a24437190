"""The watchdog: waiting for a display has no timeout, so a thread ends a process that waits too long."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from appliance.projector.projector_error import GPU_LOST

PATIENCE_S = 5.0
LOOK_S = 0.5
_STOOD_STILL_S = (
    2.0  # between two checks: this process itself was suspended, by Ctrl-Z or by a machine asleep
)
_LAST_WORDS_S = 0.5
WORDS = (
    f"The display has taken no picture for {PATIENCE_S:g} s. The audience sees one that stands still, or "
    "none; the dance goes on. The projector ends so that it can be started again (a supervisor does it by "
    "itself); if it happens often, look at the cable, the projector and the graphics card's driver."
)


class Patience:
    """Whether the display hangs. Times are monotonic seconds; before the first picture it does not."""

    def __init__(self) -> None:
        self._since: float | None = None
        self._looked_at = 0.0

    def note_swap(self, now: float) -> None:
        """The display took a picture."""
        self._since = now

    def is_over(self, now: float, is_preparing: bool) -> bool:
        """Call it often. Neither preparing a show nor a pause of the whole process counts as hanging."""
        stood_still = now - self._looked_at > _STOOD_STILL_S
        self._looked_at = now
        if self._since is None:
            return False
        if is_preparing or stood_still:
            self._since = now
        return now - self._since >= PATIENCE_S


@contextmanager
def guarded(
    patience: Patience,
    is_preparing: Callable[[], bool],
    give_up: Callable[[], None],
    monotonic: Callable[[], float] = time.monotonic,
    is_well: Callable[[float], None] = lambda now: None,
) -> Iterator[None]:
    """Run a thread that calls `is_well` while pictures are shown, and `give_up` once they hang."""
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


def end_process() -> None:
    """Report why, and end at once: a thread that waits for the display receives no signal either."""
    words = threading.Thread(target=_say, daemon=True)  # a stopped terminal must not block this
    words.start()
    words.join(_LAST_WORDS_S)
    os._exit(GPU_LOST)


def _say() -> None:
    print(f"bunraku: {WORDS}", file=sys.stderr, flush=True)
    sys.stdout.flush()
