"""Can this be a hand? Zero, torn and impossibly fast orientations are kept from the dancer."""

from __future__ import annotations

from math import acos, cos, degrees, radians, sqrt

Orientation = tuple[float, float, float, float]

NORM_TOLERANCE = 0.01  # Q14 rounding gives 6e-5; one torn byte up to 1.5e-2
FASTEST_DEGREES_S = 2000.0  # the range of the BNO055's gyroscope: its fusion cannot follow anything faster
SLACK_DEGREES = 3.0  # rounding, and a fusion that corrects itself
LONGEST_STEP_S = 0.03  # while readings are refused, the way still allowed from the last believed one
CONSISTENT_READINGS = 5  # this many in a row that agree with one another are believed: 100 ms
TIMEOUT_S = 0.5  # after this long without a believed reading the next one is believed


class PlausibilityGate:
    """One sensor's gate. Refuses single wrong readings; finds back by itself when the sensor has truly moved.

    Every rule costs at most TIMEOUT_S: a gate must never lock a dancer out.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what came before: the sensor was switched on again."""
        self._believed: Orientation | None = None
        self._believed_us = 0
        self._believed_arrival = 0.0
        self._refused: Orientation | None = None
        self._refused_us = 0
        self._agreeing = 0

    def admit(
        self, orientation: Orientation, sensor_time_us: int, arrival: float
    ) -> tuple[Orientation | None, str]:
        """The unit orientation and its fate: accepted or relocated; or None and zero, norm, torn or rate.

        `orientation` as it came (w, x, y, z); `sensor_time_us` on the device's clock, without wraps, for the
        speed of the turn; `arrival` in seconds on the box's clock for the way back, so that no device clock
        can bar it.
        """
        w, x, y, z = orientation
        norm = sqrt(w * w + x * x + y * y + z * z)
        if norm < 0.5:
            return None, "zero"
        if not abs(norm - 1.0) <= NORM_TOLERANCE:
            return None, "norm"
        unit = (w / norm, x / norm, y / norm, z / norm)
        refusal = self._refusal(orientation, unit, sensor_time_us)
        if refusal is None:
            self._believe(unit, sensor_time_us, arrival)
            return unit, "accepted"
        if self._has_moved(unit, sensor_time_us) or arrival - self._believed_arrival > TIMEOUT_S:
            self._believe(unit, sensor_time_us, arrival)
            return unit, "relocated"
        return None, refusal

    def _refusal(self, raw: Orientation, unit: Orientation, sensor_time_us: int) -> str | None:
        if self._believed is None:
            return None
        elapsed_s = (sensor_time_us - self._believed_us) * 1e-6
        if self._refused is not None:
            elapsed_s = min(elapsed_s, LONGEST_STEP_S)
        if not _within_reach(self._believed, unit, elapsed_s):
            return "rate"
        if _has_flipped_bit(self._believed, raw, unit):
            return "torn"
        return None

    def _has_moved(self, unit: Orientation, sensor_time_us: int) -> bool:
        """Whether the refused readings have agreed with one another for long enough."""
        if self._refused is not None and _within_reach(
            self._refused, unit, (sensor_time_us - self._refused_us) * 1e-6
        ):
            self._agreeing += 1
        else:
            self._agreeing = 1
        self._refused, self._refused_us = unit, sensor_time_us
        return self._agreeing >= CONSISTENT_READINGS

    def _believe(self, unit: Orientation, sensor_time_us: int, arrival: float) -> None:
        self._believed, self._believed_us, self._believed_arrival = unit, sensor_time_us, arrival
        self._refused = None
        self._agreeing = 0


def _within_reach(a: Orientation, b: Orientation, elapsed_s: float) -> bool:
    reach = radians(SLACK_DEGREES + FASTEST_DEGREES_S * max(0.0, elapsed_s))  # a clock may step back
    if reach >= 3.1415:
        return True
    return _alignment(a, b) >= cos(reach / 2)


def _has_flipped_bit(believed: Orientation, raw: Orientation, unit: Orientation) -> bool:
    """A component near 1 with its top bit flipped reads near -1: unit norm still, and up to 20 degrees off.

    Too small a step for the rate gate. It is known by its size: 2 minus what it was, so never below 1. A sign
    that changed as a whole is no step at all.
    """
    return (
        any(abs(now) >= 1.0 and now * before < 0.0 for now, before in zip(raw, believed, strict=True))
        and _degrees(believed, unit) > SLACK_DEGREES
    )


def _alignment(a: Orientation, b: Orientation) -> float:
    """|a . b|: cosine of half the angle between two unit orientations, whichever sign they have."""
    return abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])


def _degrees(a: Orientation, b: Orientation) -> float:
    return 2 * degrees(acos(min(1.0, _alignment(a, b))))
