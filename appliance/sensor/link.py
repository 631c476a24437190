"""All sensors of the box: lets them in, uses readings that are authentic and new, counts every packet."""

from __future__ import annotations

import secrets
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from types import MappingProxyType
from typing import cast

from appliance.sensor import wire
from appliance.sensor.known_sensor import KnownSensor
from appliance.sensor.memory import with_profile
from appliance.sensor.pairing import NO_HAND, USUAL_RATE_HZ, Pairing
from appliance.sensor.sensor_key import SensorKey
from appliance.sensor.state import SensorReading as SensorReading
from appliance.sensor.state import SensorState as SensorState
from appliance.sensor.transports.serial import SerialIntake
from appliance.sensor.transports.transport import Intake, Route
from appliance.sensor.transports.udp import UdpIntake

FOREIGN = frozenset(("length", "magic", "version", "kind", "device", "tag", "old_session", "old_hello"))
RESERVE_EACH_S = 1.0
LATE_LOOKS = 8  # at most, while packets of other sensors come first
HEARTBEATS_APART = 8  # sensors get their heartbeats at different eighths of a second, in key file order
REASONS = (
    "accepted",
    *("hello", "profile"),  # authentic, new, of use
    *("length", "magic", "version", "kind", "device", "tag", "other_wire"),
    *("duplicate", "reordered", "old", "ahead", "old_session", "old_hello"),
    "norm",
    "lost",  # by the gaps in the sequence
    "reboot",
)


def open_link(
    keys: Mapping[str, SensorKey],
    udp: tuple[str, int] | None = None,
    serial: Iterable[tuple[str, int]] = (),
    profiles: Mapping[bytes, bytes] = MappingProxyType({}),
    hands: Sequence[str] = (),
    foreign: tuple[UdpIntake, Mapping[str, SensorKey]] | None = None,
    rate_hz: int = USUAL_RATE_HZ,
) -> SensorLink:
    """A link over a UDP (host, port) and serial (device, baud) pairs.

    `profiles`: kept calibrations by the IMU's unique id. `hands`: sensors in the order of the show's hands.
    `foreign`: the door of foreign sensors, and their keys. `rate_hz`: readings a second of each wearable.
    Raises PortError when the UDP port cannot be opened; an absent serial device may come later.
    """
    intakes: list[Intake] = [UdpIntake(*udp)] if udp is not None else []
    intakes += (SerialIntake(device, baud) for device, baud in serial)
    door, others = foreign or (None, {})
    intakes += [door] if door is not None else []
    return SensorLink(keys, intakes, profiles, hands, others, rate_hz)


class SensorLink:
    """All sensors of the box. Time is an argument; nothing here waits, raises or logs."""

    def __init__(
        self,
        keys: Mapping[str, SensorKey],
        intakes: Sequence[Intake],
        profiles: Mapping[bytes, bytes] = MappingProxyType({}),
        hands: Sequence[str] = (),
        foreign: Mapping[str, SensorKey] = MappingProxyType({}),
        rate_hz: int = USUAL_RATE_HZ,
    ) -> None:
        self.rate_hz = rate_hz
        self.intakes = tuple(intakes)
        self.wants_neutral: set[str] = set()  # sensors whose wearers should stand still: their light shows it
        self.light = True  # whether a linked sensor's light flashes now and then
        self.sent: Counter[str] = Counter()  # packets to sensors by kind
        self._hands, self._foreign = tuple(hands), dict(foreign)
        self._profiles = dict(profiles)
        self._new_profiles: dict[bytes, bytes] = {}
        self._by_device: dict[int, KnownSensor] = {}
        self._by_name: dict[str, KnownSensor] = {}
        self._counts = dict.fromkeys(REASONS, 0)
        self._stranger: Route | None = None  # that sent the newest packet that is none of our sensors'
        self._newest: dict[str, SensorReading] = {}
        self._reserve_at = -inf
        self.set_keys(keys)

    def drain(self, now: float) -> Sequence[SensorReading]:
        """The newest accepted reading of each sensor since the last drain."""
        self._newest.clear()
        for sensor in self._by_device.values():
            sensor.arrivals.clear()
        self._receive(now)
        return tuple(self._newest.values())

    def drain_late(
        self, sensor: str, until: float, monotonic: Callable[[], float]
    ) -> Sequence[SensorReading]:
        """The same after waiting for this sensor's reading, which the last drain did not have.

        It counts as part of that drain: all readings since the one before are returned.
        """
        known = self._by_name.get(sensor)
        for _ in range(LATE_LOOKS):
            now = monotonic()
            route = None if known is None else known.pairing.route(now)
            if known is None or route is None or known.arrivals or now >= until:
                break
            intake, origin = route
            intake.await_packet(origin, until - now)
            self._receive(monotonic())
        return tuple(self._newest.values())

    def _receive(self, now: float) -> None:
        counts = self._counts
        for intake in self.intakes:
            for packet, arrival, origin in intake.receive_packets(now):
                route = (intake, origin)
                fate = self._judge(packet, arrival, route)
                counts[fate] += 1
                if fate in FOREIGN:
                    self._stranger = route

    def send_due(self, now: float) -> None:
        """Send assignments, calls, heartbeats and calibrations that are due. Once a tick, after the frame.

        `now` is the time of this call: sensors work out their round trip from its echo.
        """
        for sensor in self._by_device.values():
            for (intake, origin), packet in sensor.pairing.due_packets(
                now, self._led(sensor, now), self._profiles
            ):
                intake.send_packet(wire.pack(packet, sensor.pairing.tagger), origin)
                self.sent[type(packet).__name__.lower()] += 1
            sensor.reception.mark(now)
        if now >= self._reserve_at:
            self._reserve_at = now + RESERVE_EACH_S
            routes = [sensor.pairing.route(now) for sensor in self._by_device.values()]
            for intake in self.intakes:
                intake.reserve_sockets(
                    {route[1] for route in routes if route is not None and route[0] is intake}
                )

    def overhear(self, now: float) -> None:
        """Another box has the sensors: what they send here is neither used nor answered."""
        self.drain(now)
        for sensor in self._by_device.values():
            sensor.pairing.owe_nothing()

    def heard_at(self, now: float) -> dict[str, tuple[int, str, int]]:
        """Power-on, address and port of each linked wearable in the network."""
        found = {}
        for name, known in self._by_name.items():
            session, route = known.pairing.session, known.pairing.route(now)
            if session is not None and route is not None and len(route[1]) == 2 and name not in self._foreign:
                found[name] = session.boot_nonce, str(route[1][0]), int(route[1][1])
        return found

    def call(self, sensor: str, boot_nonce: int, address: tuple[str, int]) -> None:
        """Ask a wearable that another box has heard there to greet this one."""
        known = self._by_name.get(sensor)
        intake = next((one for one in self.intakes if isinstance(one, UdpIntake)), None)
        if known is not None and intake is not None:
            known.pairing.queue_call(boot_nonce, (intake, address))

    def states(self, now: float) -> list[SensorState]:
        """The state of each sensor of the key file, in its order."""
        return [sensor.state(now) for sensor in self._by_name.values()]

    def lets_in(self, sensor: str) -> bool:
        """Whether a sensor of this name has a key."""
        return sensor in self._by_name

    def is_foreign(self, sensor: str) -> bool:
        """Whether it is a phone or a program, which keeps no rate."""
        return sensor in self._foreign

    def refused(self) -> dict[str, int]:
        """Readings without an orientation, of each sensor that sent some."""
        return {name: one.refused for name, one in self._by_name.items() if one.refused}

    @property
    def stranger(self) -> str:
        """Where the newest packet came from that is none of our sensors'; "" before the first one."""
        return "" if self._stranger is None else self._stranger[0].describe(self._stranger[1])

    def strobe(self, sensor: str, now: float, seconds: float = 10.0) -> None:
        """Flash this sensor's light so that a person finds it. Unknown names are ignored."""
        if sensor in self._by_name:
            self._by_name[sensor].strobe_until = now + seconds

    def set_keys(self, keys: Mapping[str, SensorKey]) -> None:
        """Let in these sensors only, beside the foreign ones. One that keeps device id and key stays linked,
        even under a new name.
        """
        before, self._by_device, self._by_name = self._by_device, {}, {}
        for place, key in enumerate({**keys, **self._foreign}.values()):
            sensor = before.get(key.device_id)
            if sensor is None or sensor.key.key != key.key:
                phase_s = place % HEARTBEATS_APART / HEARTBEATS_APART
                pairing = Pairing(key, secrets.token_bytes(16), phase_s, rate_hz=self.rate_hz)
                sensor = KnownSensor(key, pairing)
            sensor.key = key
            sensor.pairing.hand = self._hands.index(key.name) if key.name in self._hands else NO_HAND
            self._by_device[key.device_id] = self._by_name[key.name] = sensor

    def take_profiles(self) -> list[tuple[bytes, bytes]]:
        """Calibrations from sensors since the last call: (unique id of the IMU, offsets)."""
        taken, self._new_profiles = self._new_profiles, {}
        return list(taken.items())

    @property
    def counts(self) -> dict[str, int]:
        """Packets by fate since the start, with the intakes' own counters."""
        counts = dict(self._counts)
        for intake in self.intakes:
            for reason, count in intake.counts.items():
                counts[reason] = counts.get(reason, 0) + count
        return counts

    def newest_arrival(self, sensor: str) -> float | None:
        """Arrival of this sensor's newest accepted reading, monotonic seconds; None before the first."""
        known = self._by_name.get(sensor)
        return known.accepted_arrival if known is not None else None

    def arrivals(self, sensor: str) -> Sequence[float]:
        """Arrivals of all accepted readings of the last drain; none for an unknown sensor."""
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

    def _judge(self, data: wire.Buffer, arrival: float, route: Route) -> str:
        """The fate of one packet, in one word. Cheap checks come before the tag."""
        found = wire.read_head(data)
        if isinstance(found, str):
            return found
        layout, (device_id, boot_nonce, session, sequence) = found
        if layout.direction != "sensor to box":
            return "kind"
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
                stale == "old_session" and layout is wire.READING and pairing.may_call(boot_nonce, arrival)
            )
            if is_of_use and pairing.tagger.is_authentic(data):
                pairing.queue_call(boot_nonce, route)
            return stale
        if not pairing.tagger.is_authentic(data):
            return "tag"
        packet = layout.decode(data)
        if isinstance(packet, wire.Reading):
            return self._take_reading(sensor, packet, arrival, route)
        if isinstance(packet, wire.Hello):
            return pairing.take_hello(packet, route, arrival)
        return self._take_profile(sensor, cast(wire.Profile, packet))

    def _take_reading(self, sensor: KnownSensor, packet: wire.Reading, arrival: float, route: Route) -> str:
        """An authentic, new reading."""
        session = sensor.pairing.session
        if session is None or session.route != route:
            self._reserve_at = -inf
        is_reboot = session is not None and session.boot_nonce != packet.boot_nonce
        self._counts["reboot"] += is_reboot
        self._counts["lost"] += sensor.take_reading(packet, route, arrival, is_reboot)
        reading, fate = sensor.to_reading(packet, arrival)
        if reading is not None:
            self._newest[reading.sensor] = reading
        return fate

    def _take_profile(self, sensor: KnownSensor, profile: wire.Profile) -> str:
        """An authentic, new calibration."""
        sensor.pairing.take_profile(profile)
        if self._profiles.get(profile.imu_id) != profile.offsets:
            self._profiles = with_profile(self._profiles, profile.imu_id, profile.offsets)
            self._new_profiles = with_profile(self._new_profiles, profile.imu_id, profile.offsets)
        return "profile"
