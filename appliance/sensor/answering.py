"""Who is owed an answer: each power-on has its own turn, so that no recording of others takes it away."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Generic, TypeVar

A_TICK = 8  # answers: more than sensors ever need, and little work whatever is replayed
MOST_WAITING = 256

Asked = TypeVar("Asked")


class Answering(Generic[Asked]):
    """What waits to be answered, by boot nonce; a power-on is answered at most once in `interval_s`."""

    def __init__(self, interval_s: float) -> None:
        self._interval_s = interval_s
        self._waiting: dict[int, Asked] = {}  # who waits longest comes first
        self._answered_at: dict[int, float] = {}  # within the last interval

    def may_ask(self, boot_nonce: int, now: float) -> bool:
        """Whether a question of this power-on would be answered now: none waits, and none just was."""
        is_due = now - self._answered_at.get(boot_nonce, -inf) >= self._interval_s
        return is_due and boot_nonce not in self._waiting and len(self._waiting) < MOST_WAITING

    def ask(self, boot_nonce: int, asked: Asked) -> None:
        """A question; it takes the place of this power-on's last one, if that waits still."""
        self._waiting[boot_nonce] = asked
        if len(self._waiting) > MOST_WAITING:
            del self._waiting[next(iter(self._waiting))]

    def due(self, now: float) -> Iterator[tuple[int, Asked]]:
        """The questions to be answered now, each with its boot nonce; they are gone then."""
        if not self._waiting:
            return
        self._answered_at = {
            boot_nonce: at for boot_nonce, at in self._answered_at.items() if now - at < self._interval_s
        }
        for boot_nonce in [one for one in self._waiting if one not in self._answered_at][:A_TICK]:
            self._answered_at[boot_nonce] = now
            yield boot_nonce, self._waiting.pop(boot_nonce)
