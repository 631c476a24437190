"""One reading and one sensor, as the link reports them."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

Orientation = tuple[float, float, float, float]

LOW_BATTERY = 15  # percent; below it the sensor's own lamp warns too


class SensorReading(NamedTuple):
    """One accepted reading. `measured_at` and `arrival` are monotonic seconds of the box."""

    sensor: str
    orientation: Orientation  # w, x, y, z, unit, sensor axes, sign continuous from reading to reading
    sequence: int
    sensor_time_us: int  # device clock, without wraps
    measured_at: float
    arrival: float
    battery: int  # percent; 255 unknown
    calibration: int  # system, gyroscope, accelerometer, magnetometer: two bits each, 3 is best
    boot_nonce: int = 0  # changes at each power-on
    taps: int = 0  # double taps since power-on; wraps at 256
    recoveries: int = 0  # restarts of the IMU since power-on; wraps at 256; its heading is lost
    flags: int = 0  # wire.HAS_PROFILE and the others, wire.signal_dbm
    round_trip_s: float | None = None  # by the newest heartbeat's echo
    wearable: int = 0  # SensorKey.wearable; changes when another wearable gets the name

    def shifted(self, seconds: float) -> SensorReading:
        """The same on a clock that is so much ahead."""
        return self._replace(measured_at=self.measured_at + seconds, arrival=self.arrival + seconds)


def restored_reading(fields: Sequence[Any] | None) -> SensorReading | None:
    """A reading from its fields in order, as a file holds them; None stays None."""
    if fields is None:
        return None
    sensor, (w, x, y, z), *others = fields
    return SensorReading(sensor, (w, x, y, z), *others)


class SensorState(NamedTuple):
    """One sensor as a technician sees it."""

    name: str
    device_id: int
    state: str  # absent, greeted, linked, lost
    way: str  # "192.168.4.7:2390", "/dev/ttyACM0", or "" before the first reading
    rate_hz: float  # readings a second, last 2 s
    loss: float  # share of readings that never came, last 10 s
    round_trip_s: float | None
    age_s: float | None  # since the newest accepted reading
    battery: int  # percent; 255 unknown
    calibration: int  # system, gyroscope, accelerometer, magnetometer: two bits each, 3 is best
    firmware: str  # "1.0.0", or "" before the first hello
    imu_id: str  # hexadecimal, or ""
    flags: int  # wire.HAS_PROFILE and the others, wire.signal_dbm
    boot_nonce: int
    complaint: str  # a sentence for people, or ""


class Reception:
    """Readings a second, and the share that is lost."""

    LOSS_S = 10.0

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self._marks: deque[tuple[float, int, int]] = deque()  # a second apart: time, received, lost

    def mark(self, now: float) -> None:
        """Note the counts; call it often, it keeps one mark a second."""
        if self._marks and now - self._marks[-1][0] < 1.0:
            return
        self._marks.append((now, self.received, self.lost))
        while now - self._marks[0][0] > self.LOSS_S:
            self._marks.popleft()

    def rate_hz(self, now: float) -> float:
        """Readings a second since the mark before the newest: over the last one to two seconds."""
        if not self._marks:
            return 0.0
        since, received, _ = self._marks[max(-2, -len(self._marks))]
        return (self.received - received) / (now - since) if now > since else 0.0

    def loss(self) -> float:
        """The share of the last 10 s that is missing; 0 without any."""
        if not self._marks:
            return 0.0
        _, received, lost = self._marks[0]
        missing, came = self.lost - lost, self.received - received
        return missing / (missing + came) if missing else 0.0
