"""Presence: the picture fades to black when nothing new comes from the stage, and back by itself."""

from __future__ import annotations

STALE_S = 0.5
FADE_S = 0.5
_LONGEST_S = 0.25  # between two pictures: who stood still for longer still fades in, in two steps


class Presence:
    """A level from 0 to 1 that follows whether fresh frames come; it starts in the dark."""

    def __init__(self) -> None:
        self.level = 0.0
        self._before: float | None = None

    def step(self, newest: float | None, now: float) -> float:
        """The level at `now`; `newest`: when the newest frame was, None without one (monotonic seconds)."""
        elapsed_s = 0.0 if self._before is None else max(0.0, now - self._before)
        self._before = now
        is_fresh = newest is not None and now - newest < STALE_S
        if is_fresh:
            self.level = min(1.0, self.level + min(elapsed_s, _LONGEST_S) / FADE_S)
        else:
            self.level = max(0.0, self.level - elapsed_s / FADE_S)
        return self.level

    def hide(self) -> None:
        """Black at once, to come back by fading: another show has begun."""
        self.level = 0.0
