"""Crossfade: from one reading head to the next, with an end that can be brought forward."""

from __future__ import annotations

from appliance.dancer.reading_head import ReadingHead
from appliance.pose.ease import ease

_HURRY = 25  # ticks that a long crossfade takes at most, once the next change waits for it


class Crossfade:
    """leaving: the head that is left; None: there is no crossfade."""

    def __init__(self, leaving: ReadingHead | None = None, fade: int = 0) -> None:
        """fade: ticks; 0: the leaving head is gone at once."""
        self.leaving = leaving if fade else None
        self._tick, self._length = 0.0, fade + 1.0

    def advance(self) -> float:
        """A tick on: how much of the entering head is there, 0 to 1."""
        self._tick += 1.0
        return ease(self._tick / self._length)

    def end_if_over(self) -> None:
        """The leaving head goes with the last tick."""
        if self._tick > self._length - 1.5:
            self.leaving = None

    def hurry(self, fade: int) -> None:
        """End a long crossfade sooner, from its present state: the next change, of `fade` ticks, waits."""
        soon = max(_HURRY, fade + 1.0)
        if self._length - self._tick > soon:
            self._length *= soon / (self._length - self._tick)
            self._tick = self._length - soon

    @property
    def times(self) -> list[float]:
        """For `restored`."""
        return [self._tick, self._length]

    @staticmethod
    def restored(leaving: ReadingHead | None, times: list[float]) -> Crossfade:
        """Go on as another one stood."""
        crossfade = Crossfade()
        crossfade.leaving, (crossfade._tick, crossfade._length) = leaving, times
        return crossfade
