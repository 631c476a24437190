"""The keeper: a process of its own that carries from memory to the disk what must survive a power cut.

The stage touches no disk while it dances: a disk that is full, read-only, gone or hangs stops the keeper alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

TURN_S = 0.5


class Carrier(Protocol):
    """Carries one thing (the journal, the place) from the runtime folder to the disk.

    complaint: what cannot be kept, in words for people, or "". Nothing here raises.
    """

    complaint: str

    def carry(self, now: float) -> None:
        """Bring the disk up to date; called each TURN_S. `now`: seconds on the monotonic clock."""

    def close(self) -> None:
        """Let go of everything, after the last turn."""


def keep_on(
    carriers: Sequence[Carrier],
    stopped: Callable[[], bool],
    say: Callable[[str], None],
    each_turn: Callable[[float], None] = lambda now: None,
    monotonic: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Turn by turn until `stopped`, then one last turn. `each_turn`: for watchdog and health."""
    raise NotImplementedError
