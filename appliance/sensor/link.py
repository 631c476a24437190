"""The box's ear: drains what sensors sent, believes what is authentic, new and plausible, counts the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Protocol, cast

from appliance.sensor import wire
from appliance.sensor.device_clock import DeviceClock
from appliance.sensor.keys import SensorKey
from appliance.sensor.plausibility import Orientation, PlausibilityGate
from appliance.sensor.serial import SerialIntake
from appliance.sensor.state import SensorReading as SensorReading
from appliance.sensor.state import SensorState as SensorState
from appliance.sensor.udp import UdpIntake

# More than the burst of eight sensors after the longest stall (8 x 13); in a flood at most 1.5 ms of a tick.
DATAGRAMS_PER_DRAIN = 128
REMEMBERED_SEQUENCES = 64
REMEMBERED_BOOTS = 1024
BOOT_SILENCE_S = 0.5  # a sensor that was switched on again was silent for longer: its IMU alone needs 0.65 s
REASONS = (
    "accepted",
    "relocated",  # accepted: refused at first, then several readings agreed
    *("length", "magic", "version", "kind", "device", "tag"),
    *("duplicate", "reordered", "old", "old_boot", "boot_overlap"),
    *("zero", "norm", "torn", "rate"),
    "lost",  # never came, by the gaps in the sequence
    "reboot",
    "drain_limit",  # drains that left datagrams for the next tick
)


class Intake(Protocol):
    """Where datagrams come from: UdpIntake, SerialIntake."""

    counts: Counter[str]

    def receive(self, now: float) -> tuple[wire.Buffer, float] | None: ...

    def close(self) -> None: ...


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
        self._by_device = {key.device_id: _Sensor(key) for key in keys.values()}
        self._by_name = {sensor.name: sensor for sensor in self._by_device.values()}
        self._counts = dict.fromkeys(REASONS, 0)
        self._newest: dict[str, SensorReading] = {}

    def drain(self, now: float) -> Sequence[SensorReading]:
        """What came since the last drain: the newest believed reading of each sensor that has one."""
        newest = self._newest
        newest.clear()
        for sensor in self._by_device.values():
            sensor.arrivals.clear()
        counts = self._counts
        for intake in self.intakes:
            for _ in range(DATAGRAMS_PER_DRAIN):
                received = intake.receive(now)
                if received is None:
                    break
                counts[self._take(*received)] += 1
            else:
                counts["drain_limit"] += 1
        return tuple(newest.values())

    def tend(self, now: float) -> None:
        """Send what is due: assignments, calls, heartbeats, calibrations. Once a tick, after the frame.

        `now` is the moment of this call: it goes into the echo from which a sensor takes its round trip.
        """

    def states(self, now: float) -> list[SensorState]:
        """How each known sensor is, in the order of the key file."""
        return []

    def strobe(self, sensor: str, now: float, seconds: float = 10.0) -> None:
        """Let this sensor's light flash brightly, so that a person finds it. A stranger is ignored."""

    def admit(self, keys: Mapping[str, SensorKey]) -> None:
        """Only these sensors from now on. Who keeps device id and key goes on, also under another name."""

    def take_profiles(self) -> list[tuple[bytes, bytes]]:
        """Calibrations that sensors have sent since the last call: (the IMU's unique id, offsets)."""
        return []

    @property
    def counts(self) -> dict[str, int]:
        """How many datagrams met each fate since the start, with what the intakes counted themselves."""
        counts = dict(self._counts)
        for intake in self.intakes:
            for reason, count in intake.counts.items():
                counts[reason] = counts.get(reason, 0) + count
        return counts

    def newest_arrival(self, sensor: str) -> float | None:
        """When this sensor's newest believed reading arrived, in monotonic seconds; None before the first."""
        return self._by_name[sensor].believed_arrival

    def arrivals(self, sensor: str) -> Sequence[float]:
        """When each believed reading of the last drain arrived, not only the newest; none for a stranger."""
        known = self._by_name.get(sensor)
        return known.arrivals if known is not None else ()

    def close(self) -> None:
        for intake in self.intakes:
            intake.close()

    def _take(self, data: wire.Buffer, arrival: float) -> str:
        """What becomes of one datagram, in one word. What is cheap to see is looked at before the tag."""
        if len(data) < wire.HEAD.size:
            return "length"
        magic, version, kind, device_id, boot_nonce, _, sequence = wire.HEAD.unpack_from(data)
        if magic != wire.MAGIC:
            return "magic"
        if version != wire.VERSION:
            return "version"
        if kind != wire.READING.kind:
            return "kind"
        if len(data) != wire.READING.size:
            return "length"
        sensor = self._by_device.get(device_id)
        if sensor is None:
            return "device"
        stale = sensor.staleness(boot_nonce, sequence, arrival)
        if stale is not None:
            return stale
        if not sensor.tagger.is_authentic(data):
            return "tag"
        packet = cast(wire.Reading, wire.READING.decode(data))
        self._counts["lost"] += sensor.advance(boot_nonce, sequence, arrival)
        self._counts["reboot"] += sensor.rebooted
        reading, fate = sensor.believe(packet, arrival)
        if reading is not None:
            self._newest[sensor.name] = reading
        return fate


class _Sensor:
    """What the box knows of one sensor: its place in the sequence, its clock, its last orientation."""

    def __init__(self, key: SensorKey) -> None:
        self.name = key.name
        self.tagger = wire.Tagger(key.key)
        self.believed_arrival: float | None = None
        self.arrivals: list[float] = []
        self.rebooted = False
        self._boot_nonce: int | None = None
        self._past_boots: dict[int, int] = {}  # boot nonce -> its newest sequence
        self._sequence = 0
        self._seen = 0  # bit n: the sequence number n before the newest has come
        self._heard = 0.0
        self._clock = DeviceClock()
        self._gate = PlausibilityGate()
        self._orientation: Orientation = (1.0, 0.0, 0.0, 0.0)

    def staleness(self, boot_nonce: int, sequence: int, arrival: float) -> str | None:
        """Why this is not new: duplicate, reordered, old, old_boot or boot_overlap; None when it is."""
        if boot_nonce == self._boot_nonce:
            age = self._sequence - sequence
            if age < 0:
                return None
            if age >= REMEMBERED_SEQUENCES:
                return "old"
            return "duplicate" if self._seen >> age & 1 else "reordered"
        if self._boot_nonce is None:
            return None
        if sequence <= self._past_boots.get(boot_nonce, -1):
            return "old_boot"
        # A recording of another night must not push out a sensor that is alive.
        return "boot_overlap" if arrival - self._heard < BOOT_SILENCE_S else None

    def advance(self, boot_nonce: int, sequence: int, arrival: float) -> int:
        """Takes an authentic, new packet as the newest; gives how many before it were lost."""
        lost = 0
        self.rebooted = False
        if boot_nonce == self._boot_nonce:
            step = sequence - self._sequence
            lost = step - 1
            self._seen = (self._seen << step | 1) & (1 << REMEMBERED_SEQUENCES) - 1 if step < 64 else 1
        else:
            if self._boot_nonce is not None:
                self._past_boots[self._boot_nonce] = self._sequence
                if len(self._past_boots) > REMEMBERED_BOOTS:
                    del self._past_boots[next(iter(self._past_boots))]
                self._clock.reset()
                self._gate.reset()
                self.rebooted = True
            self._boot_nonce = boot_nonce
            self._seen = 1
        self._sequence = sequence
        self._heard = arrival
        return lost

    def believe(self, packet: wire.Reading, arrival: float) -> tuple[SensorReading | None, str]:
        """The reading, if a hand could have made it, and what happened to it."""
        sensor_time_us = self._clock.unwrap(packet.sensor_time_us, arrival)
        measured_at = self._clock.observe(sensor_time_us, arrival)
        unit, fate = self._gate.admit(packet.orientation, sensor_time_us, arrival)
        if unit is None:
            return None, fate
        w, x, y, z = unit
        a, b, c, d = self._orientation
        if w * a + x * b + y * c + z * d < 0:
            unit = (-w, -x, -y, -z)
        self._orientation = unit
        self.believed_arrival = arrival
        self.arrivals.append(arrival)
        return (
            SensorReading(
                self.name,
                unit,
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
                None,
            ),
            fate,
        )
