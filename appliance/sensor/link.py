"""The box's ear and mouth: lets sensors in, believes what is authentic, new and plausible, counts all."""

from __future__ import annotations

import secrets
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from types import MappingProxyType
from typing import cast

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.known_sensor import KnownSensor
from appliance.sensor.memory import with_profile
from appliance.sensor.pairing import NO_HAND, Pairing
from appliance.sensor.state import SensorReading as SensorReading
from appliance.sensor.state import SensorState as SensorState
from appliance.sensor.transports.serial import SerialIntake
from appliance.sensor.transports.transport import Intake, Way
from appliance.sensor.transports.udp import UdpIntake

ATTEND_S = 1.0
HEARTBEATS_APART = 8  # sensors in the key file's order get theirs at different eighths of a second
REASONS = (
    "accepted",
    "relocated",  # accepted: refused at first, then several readings agreed
    *("hello", "profile"),  # authentic, new, of use
    *("length", "magic", "version", "kind", "device", "tag", "other_wire"),
    *("duplicate", "reordered", "old", "ahead", "old_session", "old_hello"),
    *("zero", "norm", "torn", "rate"),
    "lost",  # never came, by the gaps in the sequence
    "reboot",
)


def open_link(
    keys: Mapping[str, SensorKey],
    udp: tuple[str, int] | None = None,
    serial: Iterable[tuple[str, int]] = (),
    profiles: Mapping[bytes, bytes] = MappingProxyType({}),
    hands: Sequence[str] = (),
) -> SensorLink:
    """A link over a UDP (host, port) and serial (device, baud)s.

    `profiles`: kept calibrations by the IMU's unique id. `hands`: sensors in the order of the show's hands.
    Raises PortError when the UDP port cannot be opened; an absent serial device is waited for.
    """
    intakes: list[Intake] = [UdpIntake(*udp)] if udp is not None else []
    intakes += (SerialIntake(device, baud) for device, baud in serial)
    return SensorLink(keys, intakes, profiles, hands)


class SensorLink:
    """All sensors of the box. Time is an argument; nothing here waits, raises or logs."""

    def __init__(
        self,
        keys: Mapping[str, SensorKey],
        intakes: Sequence[Intake],
        profiles: Mapping[bytes, bytes] = MappingProxyType({}),
        hands: Sequence[str] = (),
    ) -> None:
        self.intakes = tuple(intakes)
        self.wants_neutral: set[str] = set()  # names of sensors that should stand still: their light says so
        self.light = True  # whether a linked sensor's light flashes now and then
        self.sent: Counter[str] = Counter()  # packets to sensors by kind
        self._hands = tuple(hands)
        self._profiles = dict(profiles)
        self._new_profiles: dict[bytes, bytes] = {}
        self._by_device: dict[int, KnownSensor] = {}
        self._by_name: dict[str, KnownSensor] = {}
        self._counts = dict.fromkeys(REASONS, 0)
        self._newest: dict[str, SensorReading] = {}
        self._attend_at = -inf
        self.admit(keys)

    def drain(self, now: float) -> Sequence[SensorReading]:
        """What came since the last drain: the newest believed reading of each sensor that has one."""
        newest = self._newest
        newest.clear()
        for sensor in self._by_device.values():
            sensor.arrivals.clear()
        counts = self._counts
        for intake in self.intakes:
            for packet, arrival, origin in intake.receive(now):
                counts[self._take(packet, arrival, (intake, origin))] += 1
        return tuple(newest.values())

    def tend(self, now: float) -> None:
        """Send what is due: assignments, calls, heartbeats, calibrations. Once a tick, after the frame.

        `now` is the moment of this call: it goes into the echo from which a sensor takes its round trip.
        """
        for sensor in self._by_device.values():
            for (intake, origin), packet in sensor.pairing.due(now, self._led(sensor, now), self._profiles):
                intake.send(wire.pack(packet, sensor.pairing.tagger), origin)
                self.sent[type(packet).__name__.lower()] += 1
            sensor.reception.mark(now)
        if now >= self._attend_at:
            self._attend_at = now + ATTEND_S
            ways = [sensor.pairing.way(now) for sensor in self._by_device.values()]
            for intake in self.intakes:
                intake.attend({way[1] for way in ways if way is not None and way[0] is intake})

    def states(self, now: float) -> list[SensorState]:
        """How each known sensor is, in the order of the key file."""
        return [sensor.state(now) for sensor in self._by_name.values()]

    def strobe(self, sensor: str, now: float, seconds: float = 10.0) -> None:
        """Let this sensor's light flash brightly, so that a person finds it. A stranger is ignored."""
        if sensor in self._by_name:
            self._by_name[sensor].strobe_until = now + seconds

    def admit(self, keys: Mapping[str, SensorKey]) -> None:
        """Only these sensors from now on. Who keeps device id and key goes on, also under another name."""
        before, self._by_device, self._by_name = self._by_device, {}, {}
        for place, key in enumerate(keys.values()):
            sensor = before.get(key.device_id)
            if sensor is None or sensor.key.key != key.key:
                phase_s = place % HEARTBEATS_APART / HEARTBEATS_APART
                sensor = KnownSensor(key, Pairing(key, secrets.token_bytes(16), phase_s))
            sensor.key = key
            sensor.pairing.hand = self._hands.index(key.name) if key.name in self._hands else NO_HAND
            self._by_device[key.device_id] = self._by_name[key.name] = sensor

    def take_profiles(self) -> list[tuple[bytes, bytes]]:
        """Calibrations that sensors have sent since the last call: (the IMU's unique id, offsets)."""
        taken, self._new_profiles = self._new_profiles, {}
        return list(taken.items())

    @property
    def counts(self) -> dict[str, int]:
        """How many packets met each fate since the start, with what the intakes counted themselves."""
        counts = dict(self._counts)
        for intake in self.intakes:
            for reason, count in intake.counts.items():
                counts[reason] = counts.get(reason, 0) + count
        return counts

    def newest_arrival(self, sensor: str) -> float | None:
        """When this sensor's newest believed reading arrived, in monotonic seconds; None before the first."""
        known = self._by_name.get(sensor)
        return known.believed_arrival if known is not None else None

    def arrivals(self, sensor: str) -> Sequence[float]:
        """When each believed reading of the last drain arrived, not only the newest; none for a stranger."""
        known = self._by_name.get(sensor)
        return known.arrivals if known is not None else ()

    def close(self) -> None:
        for intake in self.intakes:
            intake.close()

    def _led(self, sensor: KnownSensor, now: float) -> int:
        if now < sensor.strobe_until:
            return wire.LED_STROBE
        if sensor.key.name in self.wants_neutral:
            return wire.LED_SLOW
        return wire.LED_ON if self.light else wire.LED_OFF

    def _take(self, data: wire.Buffer, arrival: float, way: Way) -> str:
        """What becomes of one packet, in one word. What is cheap to see is looked at before the tag."""
        if len(data) < wire.HEAD.size:
            return "length"
        magic, version, kind, device_id, boot_nonce, session, sequence = wire.HEAD.unpack_from(data)
        if magic != wire.MAGIC:
            return "magic"
        if version != wire.VERSION:
            return "version"
        layout = wire.LAYOUTS.get(kind)
        if layout is None or layout.direction != "sensor to box":
            return "kind"
        if len(data) != layout.size:
            return "length"
        sensor = self._by_device.get(device_id)
        if sensor is None:
            return "device"
        pairing = sensor.pairing
        if layout is wire.READING:
            stale = pairing.reading_staleness(boot_nonce, session, sequence, arrival)
        elif layout.name == "Hello":
            stale = pairing.hello_staleness(boot_nonce, sequence)
        else:
            stale = pairing.profile_staleness(boot_nonce, session, sequence)
        if stale is not None:
            is_of_use = (
                stale == "old_session"
                and layout is wire.READING
                and pairing.is_to_be_called(boot_nonce, arrival)
            )
            if is_of_use and pairing.tagger.is_authentic(data):
                pairing.call(boot_nonce, way)
            return stale
        if not pairing.tagger.is_authentic(data):
            return "tag"
        packet = layout.decode(data)
        if isinstance(packet, wire.Reading):
            return self._hear(sensor, packet, arrival, way)
        if isinstance(packet, wire.Hello):
            return pairing.greet(packet, way, arrival)
        return self._keep(sensor, cast(wire.Profile, packet))

    def _hear(self, sensor: KnownSensor, packet: wire.Reading, arrival: float, way: Way) -> str:
        """An authentic, new reading."""
        session = sensor.pairing.session
        if session is None or session.way != way:
            self._attend_at = -inf
        is_reboot = session is not None and session.boot_nonce != packet.boot_nonce
        self._counts["reboot"] += is_reboot
        self._counts["lost"] += sensor.follow(packet, way, arrival, is_reboot)
        reading, fate = sensor.believe(packet, arrival)
        if reading is not None:
            self._newest[reading.sensor] = reading
        return fate

    def _keep(self, sensor: KnownSensor, profile: wire.Profile) -> str:
        """An authentic, new calibration."""
        sensor.pairing.keep(profile)
        if self._profiles.get(profile.imu_id) != profile.offsets:
            self._profiles = with_profile(self._profiles, profile.imu_id, profile.offsets)
            self._new_profiles = with_profile(self._new_profiles, profile.imu_id, profile.offsets)
        return "profile"
