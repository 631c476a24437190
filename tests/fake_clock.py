"""A clock that moves by `sleep` and `work` alone, and can overshoot like a busy machine."""

from __future__ import annotations

from collections.abc import Callable


class FakeTime:
    """Monotonic time under the test's control; each sleep adds the next `overshoot_s`."""

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
