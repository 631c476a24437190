"""A sensor's clock on the box's time: when a reading was measured, whatever delay the network added.

arrival = time on the sensor's clock + offset + delay, and delays are never negative, but often small. So the
line under all points (sensor time, arrival - sensor time) is the clock, and all above it is delay: the
lower hull of each second's smallest offset (S. B. Moon, P. Skelly, D. Towsley: Estimation and removal of
clock skew from network delay measurements, INFOCOM 1999). The smallest delay itself, 1 to 3 ms of Wi-Fi,
cannot be measured one way: measured times are late by it.
"""

from __future__ import annotations

from itertools import pairwise

WRAP_US = 1 << 32
BUCKET_S = 1.0
WINDOW_S = 60.0
SHORTEST_SPAN_S = 10.0  # with less, a millisecond of jitter would read as 100 ppm: no drift is assumed
LARGEST_DRIFT = 1e-3  # crystals are within 1e-4; a line steeper than this is a network that fills up
LARGEST_DELAY_S = 0.6  # when even the fastest reading of a second is later, the sensor's clock jumped
EARLIEST_S = 0.1  # a reading this much too early: the clock jumped, or all before it were held up


class DeviceClock:
    """Maps one sensor's 32-bit microseconds to the box's monotonic seconds."""

    def __init__(self) -> None:
        self._raw_us: int | None = None
        self._unwrapped_us = 0
        self._arrival = 0.0
        self._points: list[tuple[float, float]] = []  # (sensor time, smallest offset) of each second, seconds
        self._least = (0.0, 0.0)  # in the second that is still filling
        self._bucket_start: float | None = None
        self._anchor_s = 0.0  # the line: offset = height + slope * (sensor time - anchor)
        self._height = 0.0
        self._slope = 0.0

    def reset(self) -> None:
        """Forget mapping and wraps, for a sensor that was switched on again."""
        self._raw_us = None
        self._forget_line()

    @property
    def drift_ppm(self) -> float:
        """How much faster the box's clock runs than the sensor's, in parts per million; 0 until known."""
        return self._slope * 1e6

    def unwrap(self, sensor_time_us: int, arrival: float) -> int:
        """The device's microseconds without wraps; `arrival` shows how many a long silence hid."""
        if self._raw_us is None:
            self._unwrapped_us = sensor_time_us
        else:
            step_us = (sensor_time_us - self._raw_us) % WRAP_US
            missed_wraps = round(((arrival - self._arrival) * 1e6 - step_us) / WRAP_US)  # -1: it stepped back
            self._unwrapped_us += step_us + missed_wraps * WRAP_US
        self._raw_us = sensor_time_us
        self._arrival = arrival
        return self._unwrapped_us

    def observe(self, unwrapped_us: int, arrival: float) -> float:
        """When a reading was measured, on the box's clock, never after its arrival."""
        sensor_s = unwrapped_us * 1e-6
        offset = arrival - sensor_s
        if self._bucket_start is not None and sensor_s < self._bucket_start - BUCKET_S:  # it was set back
            self._forget_line()
        if self._bucket_start is None:
            self._bucket_start = self._anchor_s = sensor_s
            self._least = (sensor_s, offset)
            self._height = offset
        elif sensor_s - self._bucket_start >= BUCKET_S:
            self._close_bucket()
            self._bucket_start = sensor_s
            self._least = (sensor_s, offset)
        elif offset < self._least[1]:
            self._least = (sensor_s, offset)
        expected = self._height + self._slope * (sensor_s - self._anchor_s)
        if offset < expected:  # earlier than any before: the line was too high
            if offset < expected - EARLIEST_S:
                self._points.clear()
            self._height += offset - expected
            return arrival
        return min(arrival, sensor_s + expected)

    def _forget_line(self) -> None:
        self._points.clear()
        self._bucket_start = None
        self._slope = 0.0

    def _close_bucket(self) -> None:
        at, least = self._least
        if self._points and least > self._height + self._slope * (at - self._anchor_s) + LARGEST_DELAY_S:
            self._points.clear()
        self._points.append(self._least)
        while self._points[0][0] < at - WINDOW_S:
            self._points.pop(0)
        if self._points[-1][0] - self._points[0][0] < SHORTEST_SPAN_S:
            self._slope = 0.0
            self._anchor_s, self._height = min(self._points, key=lambda point: point[1])
        else:
            self._anchor_s, self._height, self._slope = _line_under(self._points)


def _line_under(points: list[tuple[float, float]]) -> tuple[float, float, float]:
    """(x, y, slope) of the line that touches the points from below and lies closest to them all.

    It runs along the edge of the lower convex hull over the points' mean x; its slope is bounded.
    """
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2], hull[-1]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            hull.pop()
        hull.append((x, y))
    mean = sum(x for x, _ in points) / len(points)
    for (ax, ay), (bx, by) in pairwise(hull):
        if bx >= mean:
            slope = (by - ay) / (bx - ax)
            break
    slope = min(max(slope, -LARGEST_DRIFT), LARGEST_DRIFT)
    touching_x, touching_y = min(points, key=lambda point: point[1] - slope * point[0])
    return touching_x, touching_y, slope
