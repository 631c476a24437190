"""A clock that only moves when someone sleeps or works, and that can overshoot like a busy machine."""

from __future__ import annotations

from collections.abc import Callable


class FakeTime:
    """Monotonic time under the test's control; `overshoot_s` is asked for at every sleep."""

    def __init__(self, overshoot_s: Callable[[], float] = lambda: 0.0) -> None:
        self.now = 1000.0
        self._overshoot_s = overshoot_s

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds + self._overshoot_s()

    def work(self, seconds: float) -> None:
        self.now += seconds
