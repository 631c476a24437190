"""Who is owed an answer: each power-on has its own turn, so that no recording of others takes it away."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from math import inf
from typing import Generic, TypeVar

A_TICK = 8  # answers: more than sensors ever need, and little work whatever is replayed
MOST_WAITING = 1024
REMEMBERED_BOOTS = 4096  # more than the power-ons of a sensor in the years that it keeps its key

Asked = TypeVar("Asked")


class Answering(Generic[Asked]):
    """What waits to be answered, by boot nonce; a power-on is answered at most once in `interval_s`.

    A power-on that was never answered comes first: so what is replayed, which was answered once, waits behind
    a sensor that was just switched on.
    """

    def __init__(self, interval_s: float) -> None:
        self._interval_s = interval_s
        self._new: dict[int, Asked] = {}  # never answered; who waits longest comes first
        self._waiting: dict[int, Asked] = {}  # answered before, likewise
        self._answered_at: dict[int, float] = {}  # the newest answer is the last

    def may_ask(self, boot_nonce: int, now: float) -> bool:
        """Whether a question of this power-on would be answered: none waits, and none just was."""
        answered_at = self._answered_at.get(boot_nonce, -inf)
        if boot_nonce in self._new or boot_nonce in self._waiting or now - answered_at < self._interval_s:
            return False
        has_room = len(self._new) + len(self._waiting) < MOST_WAITING
        return has_room or (answered_at == -inf and bool(self._waiting))

    def ask(self, boot_nonce: int, asked: Asked) -> None:
        """A question; it takes the place of this power-on's last one, if that waits still."""
        queue = self._waiting if boot_nonce in self._answered_at else self._new
        queue[boot_nonce] = asked
        if len(self._new) + len(self._waiting) > MOST_WAITING:
            queue = self._waiting or self._new
            del queue[next(iter(queue))]

    def due(self, now: float) -> Iterator[tuple[int, Asked]]:
        """The questions to be answered now, each with its boot nonce; they are gone then."""
        turns = [(boot_nonce, self._new) for boot_nonce in islice(self._new, A_TICK)]
        rested = (
            boot_nonce
            for boot_nonce in self._waiting
            if now - self._answered_at.get(boot_nonce, -inf) >= self._interval_s
        )
        turns += [(boot_nonce, self._waiting) for boot_nonce in islice(rested, A_TICK - len(turns))]
        for boot_nonce, queue in turns:
            self._answered_at.pop(boot_nonce, None)
            self._answered_at[boot_nonce] = now
            if len(self._answered_at) > REMEMBERED_BOOTS:
                del self._answered_at[next(iter(self._answered_at))]
            yield boot_nonce, queue.pop(boot_nonce)
