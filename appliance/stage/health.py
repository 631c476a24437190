"""The box's knowledge about itself: counters, the last second's tick times, and the line that says so."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

_SECOND_OF_TICKS = 64


@dataclass(slots=True)
class Health:
    """Counters of the run and a window of tick times; a tick touches it without allocating."""

    ticks: int = 0
    late: int = 0
    skipped: int = 0
    over_budget: int = 0
    not_finite: int = 0
    worst_ms: float = 0.0
    rate_hz: float = 0.0  # in the last second, as are the next three
    p50_ms: float = 0.0
    p99_ms: float = 0.0
    slowest_ms: float = 0.0
    _times_ms: np.ndarray = field(default_factory=lambda: np.zeros(_SECOND_OF_TICKS))
    _filled: int = 0
    _ticks_then: int = 0
    _then: float = 0.0
    _begun: float = 0.0

    def tick(self, cost_ms: float, budget_ms: float) -> None:
        """One tick is over and cost this much, milliseconds from its start to the last output."""
        self._times_ms[self._filled % _SECOND_OF_TICKS] = cost_ms
        self._filled += 1
        self.ticks += 1
        self.over_budget += cost_ms > budget_ms
        self.worst_ms = max(self.worst_ms, cost_ms)

    def begin(self, now: float) -> None:
        """The first tick is about to run: seconds on the monotonic clock."""
        self._then = self._begun = now

    def is_due(self, now: float) -> bool:
        """Once a second."""
        return now - self._then >= 1.0

    def look(self, now: float) -> None:
        """A second is over: its rate and times; the next one begins."""
        times_ms = np.sort(self._times_ms[: min(self._filled, _SECOND_OF_TICKS)])
        self.rate_hz = (self.ticks - self._ticks_then) / max(now - self._then, 1e-9)
        self.p50_ms = float(times_ms[len(times_ms) // 2]) if len(times_ms) else 0.0
        self.p99_ms = float(times_ms[int(0.99 * (len(times_ms) - 1))]) if len(times_ms) else 0.0
        self.slowest_ms = float(times_ms[-1]) if len(times_ms) else 0.0
        self._filled, self._ticks_then, self._then = 0, self.ticks, now

    def snapshot(self, now: float) -> dict[str, Any]:
        """Counters of the run and figures of the last second, for the shared frame."""
        return {
            "rate_hz": self.rate_hz,
            "late": self.late,
            "skipped": self.skipped,
            "over_budget": self.over_budget,
            "not_finite": self.not_finite,
            "ticks": self.ticks,
            "tick_p50_ms": self.p50_ms,
            "tick_p99_ms": self.p99_ms,
            "uptime_s": now - self._begun,
        }

    def line(self, coding: int, interaction: int, sensor_age_s: float | None, locked: bool) -> str:
        """The last second in one line. `sensor_age_s` None: the show has no sensor."""
        parts = [
            f"{self.rate_hz:5.1f} Hz",
            f"tick {self.p50_ms:.1f}/{self.p99_ms:.1f} ms (p50/p99)",
            f"late {self.late}",
            _age(sensor_age_s, locked),
            f"iterations {coding}/{interaction}",
        ]
        parts += [f"{name} {count}" for name, count in self.trouble() if count]
        return "  ".join(parts)

    def trouble(self) -> tuple[tuple[str, int], ...]:
        """Counters that are zero on a good night."""
        return (
            ("skipped", self.skipped),
            ("over budget", self.over_budget),
            ("network not finite", self.not_finite),
        )


def _age(sensor_age_s: float | None, locked: bool) -> str:
    if sensor_age_s is None:
        return "no sensor"
    if sensor_age_s == float("inf"):
        return "sensor not heard yet"
    return f"sensor {1000.0 * sensor_age_s:.0f} ms ago" + (", in phase" if locked else "")
