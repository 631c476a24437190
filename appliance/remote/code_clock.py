"""The code clock: follows a timecode through jitter, drift and gaps; tells a jump from a late datagram."""

from __future__ import annotations

from typing import Literal

from appliance.remote.timecode import DAY_S, RATES, Rate, Timecode, at

CodeState = Literal["absent", "locking", "running", "standing", "freewheeling"]
_GAIN, _RATE_GAIN = 0.05, 0.0013  # alpha-beta filter, critically damped: beta = alpha^2 / (2 - alpha)
_SPEEDS = 0.5, 2.0
_STANDS_AFTER = 3  # times the same label, over as many frames
_GAP_FRAMES = 8  # without any label: MIDI timecode tells a whole one in every second frame
_AGREE_S = 0.1  # how far a second label may be from where the first one leads


class CodeClock:
    """Where the timecode is now; it counts on where its labels begin anew after 24 hours.

    freewheel_s: how long it goes on when labels stay away. tolerance_s: a label that is further off is a
    jump, as soon as the next one agrees with it. jumps: how many there were; the first label counts as none.
    Times are monotonic seconds.
    """

    def __init__(self, freewheel_s: float = 1.0, tolerance_s: float = 0.2) -> None:
        self._freewheel_s, self._tolerance_s = freewheel_s, tolerance_s
        self.rate: Rate = RATES[1]
        self.speed = 1.0
        self.jumps = 0
        self._is_locked = False
        self._code_s = self._since = self._heard_at = 0.0
        self._other: tuple[float, float] | None = None  # a label that fits nowhere yet, and when it came
        self._same, self._same_since, self._newest_s = 0, 0.0, -1.0

    def hear(self, label: Timecode, now: float, ahead_frames: float = 0.0) -> None:
        """A label has come; ahead_frames: how much later than the label the code is at this moment."""
        self.rate = label.rate
        code_s, expected_s = label.time_s + ahead_frames / label.rate.per_second, self.time_s(now)
        if code_s == self._newest_s:
            self._same += 1
        else:
            self._same, self._same_since, self._newest_s = 1, now, code_s
        if expected_s is not None:
            day_s = DAY_S * round((expected_s - code_s) / DAY_S)
            code_s += day_s if abs(code_s + day_s - expected_s) <= self._tolerance_s else 0.0
        was_away = self.state(now) in ("absent", "locking")
        self._heard_at = now
        if was_away:
            self._lock(code_s, now)
        elif self._stands(now):
            self._code_s, self._since = code_s, now
        else:
            self._follow(code_s, now)

    def state(self, now: float) -> CodeState:
        silent_s = now - self._heard_at
        if not self._is_locked or silent_s > self._gap_s + self._freewheel_s:
            return "locking" if self._other is not None and silent_s <= self._gap_s else "absent"
        if self._stands(now):
            return "standing"
        return "freewheeling" if silent_s > self._gap_s else "running"

    def time_s(self, now: float) -> float | None:
        """Seconds of the code at a moment; None where there is none."""
        state = self.state(now)
        if state in ("absent", "locking"):
            return None
        return self._code_s if state == "standing" else self._code_s + self.speed * (now - self._since)

    def label(self, now: float) -> Timecode | None:
        """The label at a moment; None where there is none."""
        time_s = self.time_s(now)
        return None if time_s is None else at(time_s, self.rate)

    @property
    def _gap_s(self) -> float:
        return _GAP_FRAMES / self.rate.per_second

    def _stands(self, now: float) -> bool:
        frames_s = _STANDS_AFTER / self.rate.per_second
        return self._same >= _STANDS_AFTER and now - self._same_since >= frames_s

    def _lock(self, code_s: float, now: float) -> None:
        """Two labels that agree are a code; one may be anything."""
        was_locked, other = self._is_locked, self._other
        self._is_locked = False
        if other is not None and abs(other[0] + now - other[1] - code_s) <= _AGREE_S:
            self.jumps += was_locked and abs(self._code_s - code_s) > self._tolerance_s
            self._begin(code_s, now)
        else:
            self._other = code_s, now

    def _begin(self, code_s: float, now: float) -> None:
        self._code_s, self._since, self.speed = code_s, now, 1.0
        self._is_locked, self._other = True, None

    def _follow(self, code_s: float, now: float) -> None:
        passed_s = now - self._since
        expected_s = self._code_s + self.speed * passed_s
        error_s = code_s - expected_s
        if abs(error_s) > self._tolerance_s:
            other = self._other
            if other is not None and abs(other[0] + now - other[1] - code_s) <= _AGREE_S:
                self.jumps += 1
                self._begin(code_s, now)
            else:
                self._other = code_s, now
            return
        self._other = None
        self._code_s, self._since = expected_s + _GAIN * error_s, now
        if passed_s > 0.0:
            speed = self.speed + _RATE_GAIN * error_s / max(passed_s, 1 / self.rate.per_second / 4)
            self.speed = min(max(speed, _SPEEDS[0]), _SPEEDS[1])
