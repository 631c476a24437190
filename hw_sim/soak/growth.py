"""What a process held after its first minute and at the end: does it leak?"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

from hw_sim.soak.unit import Unit
from hw_sim.soak.vitals import Vitals

FIRST_MINUTE_S = 60.0
WINDOW_S = 10.0  # figures of memory are medians over this window
_SHORTEST_LIFE_S = 3.0


@dataclass(frozen=True)
class Growth:
    """Resources of one process after its first minute, and at the end; it has lived for `lived_s`.

    Handles and threads come and go, with receivers or for an instant: what the last quarter has more than the
    first half, at its least and at its most, was not given back.

    own_mb: memory that no file backs, which a whole life like the time from its second quarter to its last
    would have added: the least of the last quarter less the least of the second, twice. A generator has twice
    the memory while it makes a phrase, and only a process that has run for a while has what it needs. Each is
    a median over some seconds. Handles tell of mapped motions that stay.
    """

    name: str
    lived_s: float
    first: Vitals
    last: Vitals
    own_mb: float
    handles: int
    threads: int


def growth(unit: Unit, run_s: float) -> Growth | None:
    """Growth over its longest life. None when that was too short to tell.

    In a run of less than four minutes the first minute is a quarter of the run.
    """
    history = max(unit.history, unit.longest, key=len)
    if not history:
        return None
    first_at = history[0][0] + min(FIRST_MINUTE_S, run_s / 4.0)
    window_s = min(WINDOW_S, run_s / 8.0)
    last_at = history[-1][0] - window_s
    early = [held for at, held in history if first_at <= at <= first_at + window_s]
    late = [held for at, held in history if at >= last_at]
    if not early or last_at < first_at + _SHORTEST_LIFE_S:
        return None
    after = [held for at, held in history if at >= first_at]
    half, quarter = after[: len(after) // 2 + 1], after[-(len(after) // 4 + 1) :]
    return Growth(
        *(unit.name, history[-1][0] - history[0][0], _summary(early, half), _summary(late, quarter)),
        2.0 * (min(_medians(quarter)) - min(_medians(half[len(half) // 2 :]))),
        _more([held.handles for held in half], [held.handles for held in quarter]),
        _more([held.threads for held in half], [held.threads for held in quarter]),
    )


def _more(before: list[int], after: list[int]) -> int:
    return min(min(after) - min(before), max(after) - max(before))


def _medians(held: list[Vitals]) -> list[float]:
    """Own memory over windows of about WINDOW_S, MB."""
    window = min(len(held), round(WINDOW_S))
    return [
        median(one.anonymous_mb for one in held[first : first + window])
        for first in range(0, len(held) - window + 1, window)
    ]


def _summary(window: list[Vitals], while_: list[Vitals]) -> Vitals:
    """Usual memory in the window, most handles and threads in a longer while."""
    return Vitals(
        round(median(one.rss_mb for one in window), 3),
        round(median(one.anonymous_mb for one in window), 3),
        max(one.handles for one in while_),
        max(one.threads for one in while_),
    )
