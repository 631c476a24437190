"""Moves the tick to just after the primary sensor's usual arrival, so that its readings hardly wait."""

from __future__ import annotations

import numpy as np

from appliance.box.clock import TICK_S

WINDOW = 64  # arrivals, 1.3 s: at 200 ppm of clock drift their phase smears by 0.26 ms
ENOUGH = 16  # arrivals before the grid moves at all


class PhaseLock:
    """A slow loop on arrival phases. Pure: it is told arrivals and deadlines and returns a correction.

    The grid is placed so that a share `in_time` of the arrivals comes before the tick, plus `margin_s`.
    A quantile of the last arrivals, taken around their circular mean, is indifferent to how late the late
    ones are: gaps of a quarter of a second and bursts after them are a few samples among 64. The correction
    never exceeds `most_s` a tick, so outputs see no period outside 20 ms +- 0.2 ms because of it.
    """

    def __init__(
        self,
        period_s: float = TICK_S,
        *,
        in_time: float = 0.8,
        margin_s: float = 0.0001,
        gain: float = 0.05,
        most_s: float = 0.0002,
    ) -> None:
        self.period_s = period_s
        self.in_time = in_time
        self.margin_s = margin_s
        self.gain = gain
        self.most_s = most_s
        self.error_s = 0.0  # where the tick should be, from where it is; seconds
        self.arrivals = 0
        self._last_arrival = float("-inf")
        self._arrivals = np.zeros(WINDOW)
        self._angles = np.zeros(WINDOW)
        self._phases = np.zeros(WINDOW)
        self._waves = np.zeros(WINDOW)

    @property
    def locked(self) -> bool:
        """True while the tick stands within a millisecond of the place it aims for."""
        return self.arrivals >= ENOUGH and abs(self.error_s) < 0.001

    def observe(self, arrival: float) -> None:
        """One arrival of the primary sensor, seconds on the monotonic clock; a burst counts once."""
        if arrival - self._last_arrival < 0.25 * self.period_s:
            return
        self._last_arrival = arrival
        self._arrivals[self.arrivals % WINDOW] = arrival
        self.arrivals += 1

    def forget(self) -> None:
        """The sensor fell silent: run free on the present grid, and relearn the phase on its return."""
        self.arrivals = 0
        self.error_s = 0.0

    def shift_s(self, deadline: float) -> float:
        """The correction to the next period, seconds; `deadline` is that of the current tick."""
        count = min(self.arrivals, WINDOW)
        if count < ENOUGH:
            return 0.0
        self.error_s = self._wrapped(self._usual_arrival(deadline, count) + self.margin_s)
        return min(max(self.gain * self.error_s, -self.most_s), self.most_s)

    def _usual_arrival(self, deadline: float, count: int) -> float:
        """The chosen quantile of the arrivals' phases against the grid, seconds from the deadline."""
        angles, phases, waves = self._angles[:count], self._phases[:count], self._waves[:count]
        np.subtract(self._arrivals[:count], deadline, out=phases)
        np.multiply(phases, 2.0 * np.pi / self.period_s, out=angles)
        sine = float(np.sin(angles, out=waves).sum())
        cosine = float(np.cos(angles, out=waves).sum())
        centre = float(np.arctan2(sine, cosine)) * self.period_s / (2.0 * np.pi)
        phases -= centre - 0.5 * self.period_s
        np.remainder(phases, self.period_s, out=phases)
        phases.sort()
        return centre - 0.5 * self.period_s + float(phases[int(self.in_time * (count - 1))])

    def _wrapped(self, phase_s: float) -> float:
        return (phase_s + 0.5 * self.period_s) % self.period_s - 0.5 * self.period_s
