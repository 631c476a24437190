"""Fade: a value on its way from the one before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar, cast

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Fade(Generic[T]):
    """A value, the one before it, and when (monotonic seconds) and how long it goes from one to the other.

    generation: of the show state that declared it, for what the dance follows; else 0.
    """

    value: T
    before: T
    since: float = 0.0
    seconds: float = 0.0
    generation: int = 0

    def share(self, now: float) -> float:
        """0..1: how much of the way is done."""
        return part_of_fade(now, self.since, self.seconds)

    def level(self: Fade[float], now: float) -> float:
        """The number of this moment."""
        share = self.share(now)
        return self.before * (1.0 - share) + self.value * share

    def to(self, value: T, now: float, seconds: float, generation: int = 0) -> Fade[T]:
        """On to another value: from the number of this moment, or from what counts for most now."""
        before = self.value if self.share(now) >= 0.5 else self.before
        if isinstance(self.value, float) and isinstance(self.before, float):
            before = cast(T, cast("Fade[float]", self).level(now))
        return Fade(value, before, now, seconds, generation)


def part_of_fade(now: float, since: float, seconds: float) -> float:
    """How much of a fade is over, 0..1."""
    if seconds <= 0.0:
        return 1.0
    return min(max((now - since) / seconds, 0.0), 1.0)
