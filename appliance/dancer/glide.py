"""Numbers that glide: each approaches its next value over its own time."""

from __future__ import annotations

from typing import Any

import numpy as np

from appliance.pose.ease import ease

TICK_S = 0.02


class Glide:
    """values (n,): now. The first `roots` go by their square roots: stiffness so goes evenly in frequency.

    They start and end gently; at the end a value is exactly what was asked for.
    """

    SNAPSHOT = ("values", "_start", "_end", "_ticks", "_left")

    def __init__(self, count: int, roots: int = 0) -> None:
        self.values, self._start, self._end, self._ticks, self._left = np.zeros((5, count))
        self._roots = roots

    def aim(self, places: slice, values: Any, seconds: float) -> None:
        """Go to these values; 0 seconds: at once."""
        self._end[places] = values
        self._start[places] = self.values[places]
        self._ticks[places] = self._left[places] = round(seconds / TICK_S)
        if seconds < TICK_S:
            self.values[places] = values

    def step(self) -> bool:
        """One tick; whether anything moves."""
        going = self._left > 0.0
        if not going.any():
            return False
        self._left[going] -= 1.0
        part = 1.0 - self._left / np.maximum(self._ticks, 1.0)
        part = ease(part)
        roots = slice(self._roots)
        here = self._start + part * (self._end - self._start)
        start = np.sqrt(self._start[roots])
        here[roots] = (start + part[roots] * (np.sqrt(self._end[roots]) - start)) ** 2
        self.values[going] = np.where(self._left > 0.0, here, self._end)[going]
        return True
