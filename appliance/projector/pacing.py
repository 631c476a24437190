"""When the next picture is due: as the display asks for it, or by the clock where it sets no pace."""

from __future__ import annotations

import time
from collections.abc import Callable

USUAL_RATE = 60.0
_JUDGED_AFTER = 60  # pictures: a second on most displays
_TOO_FAST = 0.7  # fraction of the display's period: a display that takes pictures faster sets no pace
_ON_TIME = 0.25  # fraction of a period that a picture may begin late and keep its place on the grid
_FOLLOW = 0.1  # how far one measured swap moves the display's grid


class Pacing:
    """Gives each picture the time that it is drawn for, on an even grid: uneven times would show as judder.

    `holds_vsync`: whether showing a picture waits for the display. That must be measured: drivers promise it
    and do not keep it (a virtual display, a hidden window).
    """

    def __init__(
        self,
        rate: float,
        holds_vsync: bool,
        *,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.period_s = 1.0 / rate
        self.holds_vsync = holds_vsync
        self._now, self._sleep = monotonic, sleep
        self._grid = monotonic() - self.period_s
        self._judged_from = self._grid
        self._pictures = 0

    def wait_for_next(self) -> float:
        """Wait until the next picture is due; the time that it is drawn for, monotonic seconds."""
        self._grid += self.period_s
        now = self._now()
        if self.holds_vsync:
            self._judge(now)
            error_s = now - self._grid
            late = abs(error_s) > self.period_s / 2
            self._grid = now if late else self._grid + _FOLLOW * error_s
            return self._grid
        if now < self._grid:
            self._sleep(self._grid - now)
        elif now - self._grid > _ON_TIME * self.period_s:
            self._grid = now  # missed pictures are never made up for
        return self._grid

    def _judge(self, now: float) -> None:
        self._pictures += 1
        if self._pictures < _JUDGED_AFTER:
            return
        if now - self._judged_from < _TOO_FAST * self._pictures * self.period_s:
            self.holds_vsync = False
        self._pictures, self._judged_from = 0, now
