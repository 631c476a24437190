"""Pace: how far a pass that follows the stage advances; one that was held up advances little."""

from __future__ import annotations

_LATE = 1.5  # times the step before: a longer one was held up


class Pace:
    """Steps from pass to pass. One held up, most often with the whole machine, counts as `longest_s`.

    rate_hz: how often passes are meant to come. Where all come later, each but the first counts in full: what
    is promised in seconds takes no longer on a machine that does not keep up.
    """

    def __init__(self, longest_s: float, rate_hz: float) -> None:
        self._longest_s = max(longest_s, _LATE / rate_hz)
        self._before_s = 0.0  # the last step, held up or not
        self._then: float | None = None

    def step_s(self, now: float) -> float:
        """How much counts since the pass before; 0 in the first (monotonic seconds)."""
        passed_s = 0.0 if self._then is None else max(0.0, now - self._then)
        counted_s = min(passed_s, max(self._longest_s, _LATE * self._before_s))
        self._then, self._before_s = now, passed_s
        return counted_s
