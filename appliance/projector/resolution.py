"""How finely the scene is drawn: in smaller pictures where a machine does not keep up, else in full ones."""

from __future__ import annotations

import math
from collections import deque

SHARES = (1.0, 0.5, 0.35)  # fractions of the display's width and height; steps in between save nothing
_WINDOW_S = 1.5  # seconds of pictures that a judgement is based on
_FEWEST = 15  # pictures for a judgement
_SETTLES_S = 0.5  # after a change or a new look, whose first pictures are slow
_MOST = 0.95  # fraction of the display's period that drawing may take
_EASY = 0.7  # fraction of it that a larger picture may be expected to take
_UP_AFTER_S, _UP_AFTER_MOST_S = 20.0, 640.0  # seconds of spare time before a larger picture is tried
_FAILED_S = 60.0  # a larger picture that lasts for less has failed
_GAIN = 0.85  # smallest pictures that are too slow and save less than this blur for nothing
_HOPELESS_S = 600.0  # before smaller pictures are tried again
_TYPICAL = 0.75  # quantile of the times: a few pictures delayed by other programs do not count


class Resolution:
    """Judges how long pictures take; `share` says how large the next one is.

    It shrinks at once and grows slowly, twice as slowly after each failed attempt, and stays as it is while
    looks cross-fade. If even the smallest pictures do not help, because something else takes the time, it
    returns to full ones for ten minutes.
    """

    def __init__(self, period_s: float, adapts: bool = True) -> None:
        self._period_s, self._adapts = period_s, adapts
        self._place = 0
        self._times: deque[tuple[float, float]] = deque()
        self._look: str | None = None
        self._settled = -math.inf
        self._eased: float | None = None  # since when a larger picture would do
        self._grew = -math.inf
        self._up_after_s = _UP_AFTER_S
        self._took_s: dict[int, float] = {}  # what pictures took at each place when last judged
        self._ratios: dict[int, float] = {}  # how much longer than there they take at the next larger size
        self._left: int | None = None  # the place that was just left for a smaller one
        self._hopeless: dict[str, float] = {}  # looks that smaller pictures do not help, and until when
        self._helped: set[str] = set()  # looks that they do help, as measured twice

    @property
    def share(self) -> float:
        """A size in proportion to the display's."""
        return SHARES[self._place]

    def note_picture(self, now: float, took_s: float, look: str | None) -> bool:
        """Note the drawing time of a picture; returns whether the next one has another size.

        took_s: without waiting for the display; look None: two looks cross-fade; now: monotonic seconds.
        """
        if not self._adapts or look is None:
            self._times.clear()
            return False
        if look != self._look:
            self._look, self._left = look, None
            self._took_s.clear()
            self._ratios.clear()
            self._settle(now)
        if now < self._settled:
            return False
        self._times.append((now, took_s))
        while self._times[0][0] < now - _WINDOW_S:
            self._times.popleft()
        if len(self._times) < _FEWEST:
            return False
        in_order = sorted(took for _, took in self._times)
        return self._judge(now, in_order[round(_TYPICAL * (len(in_order) - 1))])

    def _judge(self, now: float, took_s: float) -> bool:
        self._took_s[self._place] = took_s
        if self._left is not None:
            self._ratios[self._place], self._left = self._took_s[self._left] / took_s, None
        if took_s > _MOST * self._period_s:
            return self._shrink(now)
        if self._place == 0 or self._expected(took_s) > _EASY * self._period_s:
            self._eased = None
            return False
        self._eased = now if self._eased is None else self._eased
        if now - self._eased < self._up_after_s:
            return False
        self._grew = now
        self._go(self._place - 1, now)
        return True

    def _shrink(self, now: float) -> bool:
        self._eased = None
        look, smallest = self._look or "", len(SHARES) - 1
        is_gain = self._took_s.get(smallest, math.inf) <= _GAIN * self._took_s.get(0, math.inf)
        if now < self._hopeless.get(look, -math.inf):
            if not is_gain:
                return False
            del self._hopeless[look]  # full pictures, measured once more, say otherwise
            self._helped.add(look)
            self._go(smallest, now)
            return True
        if now - self._grew < _FAILED_S:
            self._up_after_s = min(2 * self._up_after_s, _UP_AFTER_MOST_S)
        if self._place < smallest:
            self._left = self._place
            self._go(self._place + 1, now)
            return True
        if 0 in self._took_s and not is_gain and look not in self._helped:
            self._hopeless[look] = now + _HOPELESS_S
            self._go(0, now)
            return True
        return False

    def _expected(self, took_s: float) -> float:
        """Expected time of the next larger picture: from recent ones, at most in proportion to its pixels."""
        by_pixels = (SHARES[self._place - 1] / SHARES[self._place]) ** 2
        return took_s * min(by_pixels, self._ratios.get(self._place, by_pixels))

    def _go(self, place: int, now: float) -> None:
        self._place = place
        self._settle(now)

    def _settle(self, now: float) -> None:
        self._settled, self._eased = now + _SETTLES_S, None
        self._times.clear()
