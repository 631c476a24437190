"""The 50 Hz grid: absolute deadlines on the monotonic clock; missed slots are skipped, never replayed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

TICK_S = 0.02


@dataclass(slots=True)
class Slot:
    """One place on the grid. The clock reuses one object; copy what must outlive the tick.

    `deadline` and `started` are seconds on the monotonic clock; `skipped` slots before this one never ran.
    """

    tick: int = -1
    deadline: float = 0.0
    started: float = 0.0
    skipped: int = 0

    @property
    def lateness_s(self) -> float:
        """How long after its deadline the tick started, seconds; always less than one period."""
        return self.started - self.deadline


class TickClock:
    """Waits for the next deadline of a grid that never slips because a tick was long or woke late."""

    def __init__(
        self,
        period_s: float = TICK_S,
        *,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.period_s = period_s
        self.now = monotonic
        self._sleep = sleep
        self._slot = Slot(deadline=monotonic())

    def begin(self, in_s: float) -> None:
        """Call it before the first wait, when all is ready: the grid begins in this many seconds."""
        self._slot.deadline = self.now() + in_s - self.period_s

    def go_on(self, tick: int, deadline: float) -> None:
        """Go on after this slot of another box, whose deadline is in this clock's seconds."""
        self._slot.tick, self._slot.deadline = tick, deadline

    def wait(
        self, shift_s: float = 0.0, lead_s: float = 0.0, warm_up: Callable[[], object] | None = None
    ) -> Slot:
        """Sleep until the next deadline, moved by `shift_s` (the phase lock's bounded correction).

        `warm_up` is called `lead_s` before the deadline, unless that moment is over: it costs no slot.

        Slots whose whole time has passed are skipped, whether the last tick was too long or the sleep
        overshot: the slot returned is always the newest one that is due, less than one period late.
        """
        slot = self._slot
        slot.tick += 1
        slot.deadline += self.period_s + shift_s
        slot.skipped = 0
        self._skip_what_is_over()
        wait_s = slot.deadline - self.now()
        if warm_up is not None and wait_s > lead_s:
            self._sleep(wait_s - lead_s)
            warm_up()
            wait_s = slot.deadline - self.now()
        if wait_s > 0.0:
            self._sleep(wait_s)
        self._skip_what_is_over()
        return slot

    def _skip_what_is_over(self) -> None:
        slot = self._slot
        slot.started = self.now()
        missed = int((slot.started - slot.deadline) / self.period_s)
        if missed > 0:
            slot.skipped += missed
            slot.tick += missed
            slot.deadline += missed * self.period_s
