"""How far this machine's clock is ahead of the other box's."""

from __future__ import annotations

_SPAN_S = 10.0  # clocks of two machines drift apart by less than 1 ms in that time


class ClockOffset:
    """The least difference between a datagram's arrival here and its departure there, lately.

    It is too large by the shortest time that a datagram took: well below a millisecond on a cable.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Another machine, or it was switched on again."""
        self._before = self._now = float("inf")
        self._begun = float("-inf")

    def hear(self, sent: float, arrival: float) -> None:
        """A datagram: seconds on the other clock, and on this one."""
        if arrival - self._begun > _SPAN_S:
            self._before, self._now, self._begun = self._now, float("inf"), arrival
        self._now = min(self._now, arrival - sent)

    @property
    def seconds(self) -> float:
        """To be added to the other box's times; 0 before the first datagram."""
        least = min(self._before, self._now)
        return least if least < float("inf") else 0.0
