"""Presence: the picture fades to black when nothing new comes from the stage, and back by itself."""

from __future__ import annotations

import math

from appliance.box.pace import Pace
from appliance.projector.pacing import USUAL_RATE

STALE_S = 0.5
FADE_S = 0.5
_LONGEST_S = 0.25  # between two pictures: after a longer pause the fade still takes at least two steps


class Presence:
    """A level from 0 to 1 that follows whether fresh frames come; it starts in the dark.

    rate: the intended pictures a second. A pause of this process, usually of the whole machine, counts
    neither for the fade nor against the stage; slow drawing does.
    """

    def __init__(self, rate: float = USUAL_RATE) -> None:
        self.level = 0.0
        self._pace = Pace(_LONGEST_S, rate)
        self._unseen_s = math.inf  # age of the newest frame, without the pauses of this process

    @property
    def sees_stage(self) -> bool:
        """Whether the last picture had a fresh frame."""
        return self._unseen_s < STALE_S

    def step(self, newest: float | None, now: float) -> float:
        """The level at `now`; `newest`: when the newest frame was, None without one (monotonic seconds)."""
        elapsed_s = self._pace.step_s(now)
        self._unseen_s = math.inf if newest is None else min(self._unseen_s + elapsed_s, now - newest)
        if self.sees_stage:
            self.level = min(1.0, self.level + elapsed_s / FADE_S)
        else:
            self.level = max(0.0, self.level - elapsed_s / FADE_S)
        return self.level

    def hide(self) -> None:
        """Black at once, then a fade-in: another show has begun."""
        self.level = 0.0
