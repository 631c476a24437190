"""Answers owed, by power-on: each has its own turn, which no replayed recording of others can take away."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from math import inf
from typing import Generic, TypeVar

A_TICK = 8  # answers: more than sensors need, and little work whatever is replayed
MOST_WAITING = 1024
REMEMBERED_BOOTS = 4096  # more than the power-ons of a sensor in the years that it keeps its key

Asked = TypeVar("Asked")


class AnswerQueue(Generic[Asked]):
    """Questions by boot nonce; a power-on is answered at most once in `interval_s`.

    Power-ons that were never answered come first, so replayed ones wait behind a new one.
    """

    def __init__(self, interval_s: float) -> None:
        self._interval_s = interval_s
        self._new: dict[int, Asked] = {}  # never answered, longest wait first
        self._waiting: dict[int, Asked] = {}  # answered before, longest wait first
        self._answered_at: dict[int, float] = {}  # the newest answer is the last

    def has_turn(self, boot_nonce: int, now: float) -> bool:
        """Whether a question of this power-on would be answered: none waits, none was just answered."""
        answered_at = self._answered_at.get(boot_nonce, -inf)
        if boot_nonce in self._new or boot_nonce in self._waiting or now - answered_at < self._interval_s:
            return False
        has_room = len(self._new) + len(self._waiting) < MOST_WAITING
        return has_room or (answered_at == -inf and bool(self._waiting))

    def put(self, boot_nonce: int, asked: Asked) -> None:
        """Queue a question; it replaces one of this power-on that still waits."""
        queue = self._waiting if boot_nonce in self._answered_at else self._new
        queue[boot_nonce] = asked
        if len(self._new) + len(self._waiting) > MOST_WAITING:
            queue = self._waiting or self._new
            del queue[next(iter(queue))]

    def clear(self) -> None:
        """Owe nothing."""
        self._new.clear()
        self._waiting.clear()

    def take_due(self, now: float) -> Iterator[tuple[int, Asked]]:
        """Remove and give the questions to answer now, each with its boot nonce."""
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
