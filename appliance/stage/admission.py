"""Start-up admission: how many coding iterations fit the tick's budget on this machine, measured warm.

Times are processor time: what other programs take meanwhile says nothing about the show, and a real-time
stage does not wait for them. A start on a hot or throttled processor may still measure too much, so a show
that was lowered is looked at again while it dances (`SecondLook`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

Dance = Callable[[int, int], object]  # runs the puppet once with K coding and J interaction iterations

PACED = (
    2.0  # a paced tick costs twice a back-to-back run: caches and clocks cool down in the pause (measured)
)
MOST_ITERATIONS = 64
_WARM_UP = 3
_REPEATS = 3
_RUNS = 60
_FEWEST_RUNS = 8
_PATIENCE_S = 0.15  # a start may take 1.5 s in all
_AGREE = 0.2  # fraction of the budget: the slowest run is no further above the usual one
_SECOND_LOOK_S = 10


@dataclass(frozen=True)
class Admission:
    """The iterations that the box will dance with, and why.

    Times are milliseconds of one run of all puppets as paced on stage; `one_ms` is the p99 of a single
    iteration.
    """

    asked_coding: int
    asked_interaction: int
    coding: int
    interaction: int
    most_coding: int
    one_ms: float
    p50_ms: float
    p99_ms: float
    budget_ms: float
    puppets: int = 1

    @property
    def fits(self) -> bool:
        """True when the show's own iterations fit."""
        return self.p99_ms <= self.budget_ms

    def sentence(self) -> str:
        """The verdict for people: what was measured, what it means for the show, what to do."""
        of = f" of {self.puppets} puppets" if self.puppets > 1 else ""
        if self.fits:
            return (
                f"{self.coding} coding iterations{of} cost {self.p99_ms:.1f} ms (p99, paced) "
                f"of a budget of {self.budget_ms:.1f} ms; up to {self.most_coding} would fit."
            )
        idle = " The hands move nothing." if self.interaction == 0 < self.asked_interaction else ""
        return (
            f"{self.asked_coding} coding iterations{of} do not fit: they cost {self.p99_ms:.1f} ms "
            f"(p99, paced) of a budget of {self.budget_ms:.1f} ms. On stage the dancer runs with "
            f"{self.coding}, {self.interaction} of them interactive: it follows the phrase more "
            f"closely.{idle} "
            f"Lower dancer.coding_iterations to {self.most_coding}, choose a faster network, "
            "or raise limits.tick_budget_ms."
        )


class SecondLook:
    """Whether a show that admission lowered fits after all, by the ticks that it dances."""

    def __init__(self, admission: Admission) -> None:
        self._asked, self._budget_ms = admission.asked_coding, admission.budget_ms
        self._is_over, self._seconds, self._dearest_ms = admission.fits, 0, 0.0

    def most_that_fits(self, slowest_ms: float, coding: int) -> int:
        """Once a second: how many coding iterations fit, once the asked ones fitted for ten seconds; else 0.

        slowest_ms: the slowest tick of this second, at `coding` iterations. A whole tick is taken to grow
        with them, which is more than it does.
        """
        one_ms = max(slowest_ms / max(coding, 1), self._budget_ms / MOST_ITERATIONS)
        if self._is_over or one_ms * self._asked > self._budget_ms:
            self._seconds, self._dearest_ms = 0, 0.0
            return 0
        self._seconds, self._dearest_ms = self._seconds + 1, max(self._dearest_ms, one_ms)
        self._is_over = self._seconds == _SECOND_LOOK_S
        return int(self._budget_ms / self._dearest_ms) if self._is_over else 0


def admit(
    dance: Dance,
    coding: int,
    interaction: int,
    budget_ms: float,
    *,
    clock: Callable[[], float] = time.thread_time,
) -> Admission:
    """Measure `dance` at the show's iterations; where that does not fit, find the most that does.

    The free passes (coding - interaction) are kept when iterations are lowered; one iteration always runs.
    """
    p50_ms, p99_ms = cost_ms(dance, coding, interaction, budget_ms, clock)
    one_ms = p99_ms
    if coding > 1:
        one_ms = min(cost_ms(dance, 1, min(1, interaction), budget_ms, clock)[1], p99_ms)
    most = _most_that_fits(coding, one_ms, p99_ms, budget_ms)
    if p99_ms > budget_ms and coding > 1:
        most = min(most, coding - 1)
        while most > 1:
            cost = cost_ms(dance, *lowered(coding, interaction, most), budget_ms, clock)
            if cost[1] <= budget_ms:
                break
            most -= max(1, most // 8)
    allowed = min(coding, most)
    return Admission(
        asked_coding=coding,
        asked_interaction=interaction,
        coding=allowed,
        interaction=lowered(coding, interaction, allowed)[1],
        most_coding=most,
        one_ms=one_ms,
        p50_ms=p50_ms,
        p99_ms=p99_ms,
        budget_ms=budget_ms,
    )


def cost_ms(
    dance: Dance, coding: int, interaction: int, budget_ms: float, clock: Callable[[], float]
) -> tuple[float, float]:
    """Median and p99 of warm runs, in milliseconds, times the price of pacing.

    Where the usual run fits the budget and the slowest takes much longer, another program may have come
    between, and one such run would limit the whole show: the measurement is repeated and the best one counts.
    A network that is slow now and then is slow each time.
    """
    best = _measured_ms(dance, coding, interaction, clock)
    for _ in range(_REPEATS):
        if best[0] > budget_ms or (best[1] <= budget_ms and best[1] - best[0] <= _AGREE * budget_ms):
            break
        best = min(best, _measured_ms(dance, coding, interaction, clock), key=lambda cost: cost[1])
    return best


def _measured_ms(
    dance: Dance, coding: int, interaction: int, clock: Callable[[], float]
) -> tuple[float, float]:
    for _ in range(_WARM_UP):
        dance(coding, interaction)
    costs: list[float] = []
    begun = clock()
    while len(costs) < _RUNS and (len(costs) < _FEWEST_RUNS or clock() - begun < _PATIENCE_S):
        before = clock()
        dance(coding, interaction)
        costs.append(clock() - before)
    costs.sort()
    paced_ms = [1000.0 * PACED * cost for cost in costs]
    return paced_ms[len(costs) // 2], paced_ms[math.ceil(0.99 * len(costs)) - 1]


def _most_that_fits(coding: int, one_ms: float, all_ms: float, budget_ms: float) -> int:
    """Cost grows by the same amount with every iteration: a straight line through the two measurements."""
    slope_ms = (all_ms - one_ms) / (coding - 1) if coding > 1 else one_ms
    if slope_ms <= 0.0:
        return MOST_ITERATIONS if one_ms <= budget_ms else 1
    return max(1, min(MOST_ITERATIONS, 1 + int((budget_ms - one_ms) / slope_ms)))


def lowered(coding: int, interaction: int, most: int) -> tuple[int, int]:
    """Coding and interaction iterations where at most `most` fit: the free passes are kept."""
    allowed = min(coding, most)
    return allowed, max(0, min(allowed, allowed - (coding - interaction)))
