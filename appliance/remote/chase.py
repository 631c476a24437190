"""Chasing a timecode: which cue is due, and how fast the phrase has to play to stay with it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from appliance.remote.timecode import DAY_S, Rate, time_of
from appliance.show_control.packet import Message

_FADE_IN_S = 3.0  # after a jump the phrase is left alone for so long: its crossfade runs
_CLOSES_S = 10.0  # in which a small error is taken away
_MOST = 0.03  # share of the speed: nobody sees it
_SAME = 2e-4  # speeds that differ by less are one
_FAR_S, _NEAR_S = 0.02, 0.005  # further than a frame of the dance: is brought as near as this
_BACK_S = 0.1  # a code that goes back by less was late, or stood still before that was noticed
_LEARNS, _MOST_LEARNED = 0.004, 0.01  # share of the error a second: the box's clock drifts against the code


def timed_cues(cues: Sequence[Mapping[str, Any]], rate: Rate) -> list[tuple[float, str]]:
    """Second and name of each cue of the show that has an `at`, in the order of time."""
    return sorted((time_of(str(cue["at"]), rate), str(cue["name"])) for cue in cues if cue.get("at"))


class CueChase:
    """Calls each cue as its time comes; after a jump the one that is in force there.

    A cue called by hand stays until the next one is due.
    """

    def __init__(self) -> None:
        self._before: tuple[float, str] | None = None

    def due(self, time_s: float | None, cues: Sequence[tuple[float, str]]) -> str | None:
        """The cue to call now; None: none. time_s: of the code, None where there is none. It counts on at
        midnight; each cue has its time in each day.
        """
        if time_s is None:
            return None
        today = int(time_s // DAY_S)
        days = [day * DAY_S for day in (today - 1, today) if day >= 0]
        reached = [(begin + at, name) for begin in days for at, name in cues if begin + at <= time_s]
        newest, before = (reached[-1] if reached else None), self._before
        if newest == before or self._is_in_force(time_s):
            return None
        self._before = newest
        if newest is None or (before is not None and _is_of_later_day(before, newest)):
            return None
        return newest[1]

    def start(self, time_s: float) -> float:
        """When the cue that is in force began, in seconds of the code; 0 before the first."""
        return self._before[0] if self._before is not None and self._before[0] <= time_s + _BACK_S else 0.0

    def _is_in_force(self, time_s: float) -> bool:
        """Whether the newest cue has only just begun, and the code is hardly before it."""
        return self._before is not None and time_s < self._before[0] <= time_s + _BACK_S


def _is_of_later_day(cue: tuple[float, str], other: tuple[float, str]) -> bool:
    """The same cue: the code has jumped, and counts its days from there."""
    days = (cue[0] - other[0]) / DAY_S
    return cue[1] == other[1] and days > 0 and days == int(days)


class DanceChase:
    """Keeps the phrase in step with the code: small errors by its speed, large ones by a jump.

    tolerance_s: an error above it is a jump. error_s: how far the phrase is behind, at the last look.
    """

    def __init__(self, tolerance_s: float) -> None:
        self._tolerance_s = tolerance_s
        self._sent: float | None = None
        self._left_alone_until = -math.inf
        self._looked_at = -math.inf
        self._drift, self._closes = 0.0, False
        self.error_s = 0.0

    def follow(
        self, health: Mapping[str, Any], time_at: float | None, speed: float, stands: bool, now: float
    ) -> Iterator[Message]:
        """Commands for the player, from the stage's newest report about itself.

        time_at: seconds of the code since the cue in force began, at the moment of that report; None: there
        is none, and the show's own speed holds again. speed: of the code, against the clock.
        """
        led = next((one for one in health.get("puppets", ()) if one.get("is_led")), None)
        looked_at = float(health.get("looked_at", -math.inf))
        if led is None or looked_at == self._looked_at or now < self._left_alone_until:
            return
        self._looked_at = looked_at
        begin, end = led.get("excerpt_s") or (0.0, 0.0)
        if time_at is None or led.get("made") or end - begin <= self._tolerance_s:
            if self._sent is not None:
                self._sent = None
                yield ("/player/start",)
            return
        length = end - begin
        behind = (time_at - (float(led["position_s"]) - begin)) % length
        self.error_s = behind - length if behind > length / 2 else behind
        if abs(self.error_s) > self._tolerance_s:
            self._left_alone_until = now + _FADE_IN_S
            ahead_s = 0.0 if stands else now - looked_at
            yield "/player/jump", begin + (time_at + ahead_s) % length
            self._closes = False
        else:
            self._drift += _LEARNS * self.error_s
            self._drift = min(max(self._drift, -_MOST_LEARNED), _MOST_LEARNED)
            self._closes = abs(self.error_s) > (_NEAR_S if self._closes else _FAR_S)
        closing = min(max(self.error_s / _CLOSES_S, -_MOST), _MOST) if self._closes else 0.0
        wanted = 0.0 if stands else speed + self._drift + closing
        if self._sent is None or abs(wanted - self._sent) > _SAME:
            self._sent = wanted
            yield "/player/rate", wanted
