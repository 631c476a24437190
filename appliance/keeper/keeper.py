"""The keeper: processes of its own that carry from memory to the disk what must survive a power cut.

The stage touches no disk while it dances: a disk that is full, read-only, gone or hangs stops these alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

TURN_S = 0.5
# The machine goes down: whoever starts after the stage ends before it (the lights may take 4 s), then the
# stage says that its show has ended (it may take 3 s). Beside a stage of one's own it says so at once.
END_S, END_BESIDE_S = 8.0, 1.0
LOOK_S = 0.05  # how often it looks whether it is to end


class Carrier(Protocol):
    """Carries one thing (the journal, the place, the sensors' memory) from the runtime folder to the disk.

    complaint: what cannot be kept, in words for people, or ""; fallback: the name under which it is told.
    """

    complaint: str
    fallback: str

    def turn(self, now: float) -> None:
        """Bring the disk up to date; monotonic seconds. Waits as long as the disk does. Never raises."""

    def last_turn(self) -> None:
        """Before the process ends: the rest. Never raises."""


def keep_on(
    carriers: Sequence[Carrier],
    stopped: Callable[[], bool],
    after_turn: Callable[[float], None] = lambda now: None,
    monotonic: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    goes_on: Callable[[], bool] = lambda: False,
    end_s: float = END_S,
) -> None:
    """Turn by turn until `stopped`, then one last turn; `after_turn`: for the watchdog.

    A show that still `goes_on` then is carried until its end, for `end_s` at most: an end that is not on the
    disk would be taken for a power cut. Each is given the time at which it begins: the disk may have held up
    those before it.
    """
    asked_at: float | None = None

    def is_over() -> bool:
        nonlocal asked_at
        if asked_at is None and stopped():
            asked_at = monotonic()
        return asked_at is not None and (not goes_on() or monotonic() - asked_at >= end_s)

    while not is_over():
        until = monotonic() + TURN_S
        for carrier in carriers:
            carrier.turn(monotonic())
        after_turn(monotonic())
        while not is_over() and (rest_s := until - monotonic()) > 0.0:
            sleep(min(rest_s, LOOK_S))
    for carrier in carriers:
        carrier.last_turn()
