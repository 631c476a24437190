"""One sensor of the key file: its pairing, clock, last orientation and state."""

from __future__ import annotations

from math import inf, sqrt

from appliance.sensor import wire
from appliance.sensor.device_clock import DeviceClock
from appliance.sensor.pairing import LOST_S, Pairing
from appliance.sensor.sensor_key import SensorKey
from appliance.sensor.state import Orientation, Reception, SensorReading, SensorState
from appliance.sensor.transports.transport import Route

NORM_TOLERANCE = 0.01  # Q14 rounding gives 6e-5
CONTESTED_S = 30.0  # two wearables with one key swap places every 3 s


class KnownSensor:
    """Turns authentic, new packets into readings."""

    def __init__(self, key: SensorKey, pairing: Pairing) -> None:
        self.key = key
        self.wearable = key.wearable
        self.pairing = pairing
        self.reception = Reception()
        self.accepted_arrival: float | None = None
        self.refused = 0  # readings without an orientation
        self.arrivals: list[float] = []  # the accepted readings of one drain
        self.strobe_until = -inf
        self._clock = DeviceClock()
        self._orientation: Orientation = (1.0, 0.0, 0.0, 0.0)

    def take_reading(self, packet: wire.Reading, route: Route, arrival: float, is_reboot: bool) -> int:
        """Take an authentic, new reading as the newest. Returns how many before it were lost."""
        if is_reboot:
            self._clock.reset()
        lost = self.pairing.take_reading(packet, route, arrival)
        self.reception.received += 1
        self.reception.lost += lost
        return lost

    def to_reading(self, packet: wire.Reading, arrival: float) -> tuple[SensorReading | None, str]:
        """The reading, if it holds an orientation, and its fate.

        The wearable, which knows when its IMU was read, refuses what no hand can do before it signs. The box
        checks only the length: poses are made of it, and a wearable of another maker may have no such gate.
        """
        sensor_time_us = self._clock.unwrap(packet.sensor_time_us, arrival)
        measured_at = self._clock.observe(sensor_time_us, arrival)
        w, x, y, z = packet.orientation
        norm = sqrt(w * w + x * x + y * y + z * z)
        if abs(norm - 1.0) > NORM_TOLERANCE:
            self.refused += 1
            return None, "norm"
        a, b, c, d = self._orientation
        if w * a + x * b + y * c + z * d < 0:
            norm = -norm
        self._orientation = (w / norm, x / norm, y / norm, z / norm)
        self.accepted_arrival = arrival
        self.arrivals.append(arrival)
        return (
            SensorReading(
                self.key.name,
                self._orientation,
                packet.sequence,
                sensor_time_us,
                measured_at,
                arrival,
                packet.battery,
                packet.calibration,
                packet.boot_nonce,
                packet.taps,
                packet.recoveries,
                packet.flags,
                _round_trip_s(packet),
                self.wearable,
            ),
            "accepted",
        )

    def state(self, now: float) -> SensorState:
        session, hello = self.pairing.session, self.pairing.hello
        newest = session.newest if session is not None else None
        last = newest or hello
        age_s = None if self.accepted_arrival is None else max(0.0, now - self.accepted_arrival)
        return SensorState(
            name=self.key.name,
            device_id=self.key.device_id,
            state=self._word(now),
            way=self.key.source or ("" if session is None else session.route[0].describe(session.route[1])),
            rate_hz=self.reception.rate_hz(now),
            loss=self.reception.loss(),
            round_trip_s=None if newest is None else _round_trip_s(newest),
            age_s=age_s,
            battery=wire.BATTERY_UNKNOWN if last is None else last.battery,
            calibration=0 if newest is None else newest.calibration,
            firmware="" if hello is None else _firmware(hello),
            imu_id="" if hello is None else hello.imu_id.hex(),
            flags=0 if last is None else last.flags,
            boot_nonce=0 if last is None else last.boot_nonce,
            complaint=self._complaint(now),
        )

    def _word(self, now: float) -> str:
        pairing = self.pairing
        if pairing.route(now) is not None:
            return "linked"
        if now - pairing.greeted_at < LOST_S:
            return "greeted"
        return "absent" if pairing.newest_hello is None else "lost"

    def _complaint(self, now: float) -> str:
        if now - self.pairing.contested_at < CONTESTED_S:
            name = self.key.name
            return (
                f"Two wearables are on with the key of {name} and take its place from each other: its joint "
                "jumps between them. Switch one of them off, and provision it under another name. "
                f"Is there only one? Its key was copied: bunraku provision --name {name} gives it another."
            )
        if self.pairing.route(now) is not None:
            session = self.pairing.session
            newest = session.newest if session is not None else None
            return self._about_radio(newest.flags if newest is not None else 0)
        hello = self.pairing.newest_hello
        if hello is None or hello.wire_hash == wire.WIRE_HASH:
            return ""
        return (
            f"Sensor {self.key.name} speaks another wire (its firmware {_firmware(hello)}: "
            f"{hello.wire_hash:08x}, this box: {wire.WIRE_HASH:08x}) and is not let in. "
            "Its joint moves freely. "
            "Flash it with the firmware/wearable of this version, or update the box."
        )

    def _about_radio(self, flags: int) -> str:
        if not flags & wire.RADIO_IS_OLD:
            return ""
        return (
            f"The radio of sensor {self.key.name} has firmware older than 19.5.4, which hangs at an empty "
            "packet from anyone in its network. The dance goes on. Update it before the next show: the "
            "updater of WiFi101 does that."
        )


def _firmware(hello: wire.Hello) -> str:
    return f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"


def _round_trip_s(packet: wire.Reading) -> float | None:
    return None if packet.round_trip == wire.ROUND_TRIP_UNKNOWN else packet.round_trip * 1e-4
