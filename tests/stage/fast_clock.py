"""A clock that does not wait. Import it before the box's modules, which have its functions as defaults.

It stays in force for its process; sleeping moves it on.
"""

from __future__ import annotations

import time

from tests.fake_clock import FakeTime


class FastClock(FakeTime):
    """meanwhile: called in each sleep, with its end; it may move the clock on to there."""

    def __init__(self) -> None:
        super().__init__()
        self.now, self.meanwhile = time.monotonic(), lambda until: None

    def sleep(self, seconds: float) -> None:
        until = self.now + seconds
        self.meanwhile(until)
        self.now = max(self.now, until)


CLOCK = FastClock()
time.monotonic, time.sleep = CLOCK.monotonic, CLOCK.sleep
