"""Histogram of delays in steps of 0.1 ms: constant memory for a run of any length."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

STEP_MS = 0.1
LONGEST_MS = 2000.0
SLOT_MS = 20.0


class Delays:
    """A histogram of delays in milliseconds. Longer delays count as LONGEST_MS."""

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros(round(LONGEST_MS / STEP_MS) + 1, np.int64)
        self.worst_ms = 0.0

    def add(self, delay_ms: float) -> None:
        """Add one; early counts as in time."""
        self._counts[round(min(max(delay_ms, 0.0), LONGEST_MS) / STEP_MS)] += 1
        self.worst_ms = max(self.worst_ms, delay_ms)

    @property
    def count(self) -> int:
        """How many were added."""
        return int(self._counts.sum())

    def later_than(self, limit_ms: float) -> int:
        """How many came later than this."""
        return int(self._counts[max(int(limit_ms / STEP_MS) + 1, 0) :].sum())

    def whole_slots(self) -> int:
        """How many whole slots of 20 ms passed while late ones were awaited."""
        slots = (np.arange(len(self._counts)) * STEP_MS / SLOT_MS).astype(np.int64)
        return int((slots * self._counts).sum())

    def percentile(self, share: float) -> float | None:
        """The delay that this share (0 to 100) did not exceed, milliseconds; None before the first one."""
        if not self.count:
            return None
        place = int(np.searchsorted(np.cumsum(self._counts), share / 100.0 * self.count))
        return round(place * STEP_MS, 1)

    def figures(self) -> dict[str, float | None]:
        """Percentiles for people."""
        found = {f"p{share:g}": self.percentile(share) for share in (50, 99, 99.9)}
        return {**found, "max": round(self.worst_ms, 1)}


class Seconds:
    """Something in each second of the run: the worst delay, or how often it happened."""

    def __init__(self) -> None:
        self.worst_ms: dict[int, float] = {}
        self.bad: Counter[int] = Counter()

    def note(self, second: int, delay_ms: float, bad: int) -> None:
        """Delays of this second, and how many slots it spoilt."""
        self.worst_ms[second] = max(self.worst_ms.get(second, 0.0), delay_ms)
        if bad:
            self.bad[second] += bad
