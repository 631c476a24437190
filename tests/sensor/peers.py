"""A wearable in the tests' hands: real packets, made when asked for; and a link on invented times."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping
from math import cos, radians, sin

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, SensorReading, SensorState
from appliance.sensor.transports.transport import Origin

KEYS = {
    "left-wrist": SensorKey("left-wrist", 0x11, bytes(range(16))),
    "head": SensorKey("head", 0x22, bytes(range(16, 32))),
}
EIGHT = {f"hand-{n}": SensorKey(f"hand-{n}", 0x100 + n, bytes([n]) * 16) for n in range(8)}
IMU_ID = bytes(range(0x40, 0x50))
A, B = ("192.168.4.7", 2390), ("192.168.4.8", 2390)
STRANGER = ("192.168.4.66", 6666)
BELIEVED = ("accepted", "hello", "profile")


class Wearable:
    """One power-on of one sensor. Counts its packets as the firmware does."""

    def __init__(self, key: SensorKey, boot: int = 1, flags: int = 0) -> None:
        self.key, self.boot, self.flags = key, boot, flags
        self.tagger = wire.Tagger(key.key)
        self.session = 0
        self.sequence = 0  # of readings
        self.hellos = 0
        self.profiles = 0
        self.heard: list[wire.Packet] = []

    def hello(self, wire_hash: int = wire.WIRE_HASH) -> bytes:
        self.hellos += 1
        head = self.key.device_id, self.boot, self.session, self.hellos
        return wire.pack(wire.Hello(*head, wire_hash, 1, 2, 3, 80, self.flags, IMU_ID), self.tagger)

    def reading(self, degrees: float = 0.0, time_us: int | None = None, **fields: int) -> bytes:
        self.sequence += 1
        return self.numbered(self.sequence, degrees, time_us, **fields)

    def numbered(
        self,
        sequence: int,
        degrees: float = 0.0,
        time_us: int | None = None,
        length: float = 1.0,
        **fields: int,
    ) -> bytes:
        half = radians(degrees) / 2
        moment_us = 20_000 * sequence % 2**32 if time_us is None else time_us
        reported = {"calibration": 0x3C, "battery": 80, "round_trip": 23, "taps": 1, "recoveries": 2} | fields
        packet = wire.Reading(
            self.key.device_id,
            self.boot,
            self.session,
            sequence,
            moment_us,
            (length * cos(half), length * sin(half), 0.0, 0.0),
            flags=reported.pop("flags", self.flags),
            **reported,
        )
        return wire.pack(packet, self.tagger)

    def profile(self, offsets: bytes = bytes(22), imu_id: bytes = IMU_ID) -> bytes:
        self.profiles += 1
        head = self.key.device_id, self.boot, self.session, self.profiles
        return wire.pack(wire.Profile(*head, imu_id, offsets), self.tagger)

    def hear(self, data: bytes) -> wire.Packet:
        """Believes what is authentic; an assignment for this power-on gives it its session."""
        packet = wire.unpack(data, lambda device: self.tagger if device == self.key.device_id else None)
        if isinstance(packet, wire.Assignment) and packet.boot_nonce == self.boot:
            assert packet.hello_sequence == self.hellos
            self.session = packet.session
        self.heard.append(packet)
        return packet


class Wires:
    """An intake without a network: what is put in comes out, and what is sent is kept."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.waiting: deque[tuple[bytes, float, Origin]] = deque()
        self.sent: list[tuple[bytes, Origin]] = []
        self.attended: set[Origin] = set()

    def receive_packets(self, now: float) -> Iterator[tuple[bytes, float, Origin]]:
        while self.waiting:
            yield self.waiting.popleft()

    def send_packet(self, packet: bytes, origin: Origin) -> None:
        self.sent.append((packet, origin))

    def await_packet(self, origin: Origin, seconds: float) -> None:
        """Nothing comes while it waits."""

    def reserve_sockets(self, origins: Collection[Origin]) -> None:
        self.attended = set(origins)

    def describe(self, origin: Origin) -> str:
        return f"{origin[0]}:{origin[1]}"

    def close(self) -> None:
        self.waiting.clear()


class Box:
    """A link on invented times."""

    def __init__(
        self,
        keys: Mapping[str, SensorKey] = KEYS,
        profiles: Mapping[bytes, bytes] | None = None,
        hands: tuple[str, ...] = (),
        now: float = 100.0,
    ) -> None:
        self.wires, self.cable = Wires(), Wires()
        self.link = SensorLink(keys, [self.wires, self.cable], profiles or {}, hands)
        self.now = now

    def hear(
        self, *packets: bytes, origin: Origin = A, wires: Wires | None = None
    ) -> tuple[SensorReading, ...]:
        (wires or self.wires).waiting.extend((packet, self.now, origin) for packet in packets)
        return tuple(self.link.drain(self.now))

    def answers(self, wires: Wires | None = None) -> list[tuple[bytes, Origin]]:
        """What the box sends now, and where to."""
        self.link.send_due(self.now)
        wires = wires or self.wires
        sent, wires.sent = wires.sent, []
        return sent

    def pair(self, name: str = "left-wrist", boot: int = 1, origin: Origin = A, flags: int = 0) -> Wearable:
        """A sensor that was switched on, greeted and assigned; it has not sent any reading yet."""
        wearable = Wearable(self.link_keys[name], boot, flags)
        self.greet(wearable, origin)
        return wearable

    def greet(self, wearable: Wearable, origin: Origin = A) -> None:
        """Hello and assignment; the clock goes on by the shortest time between two assignments."""
        self.now += 0.2
        self.hear(wearable.hello(), origin=origin)
        sessions = [
            wearable.hear(data)
            for data, to in self.answers()
            if to == origin and data[3] == 2 and data[4:8] == wearable.key.device_id.to_bytes(4, "little")
        ]
        assert sessions, "no assignment came"

    @property
    def link_keys(self) -> dict[str, SensorKey]:
        return {name: sensor.key for name, sensor in self.link._by_name.items()}

    def counted(self) -> dict[str, int]:
        return {reason: count for reason, count in self.link.counts.items() if count}


def believed(box: Box) -> dict[str, int]:
    return {reason: count for reason, count in box.counted().items() if reason in BELIEVED}


def linked_box() -> tuple[Box, Wearable]:
    """A sensor dances; the box owes it nothing at this moment."""
    box = Box()
    sensor = box.pair()
    for _ in range(60):
        box.now += 0.02
        assert len(box.hear(sensor.reading())) == 1
        box.answers()
    return box, sensor


def state(box: Box, name: str = "left-wrist") -> SensorState:
    return next(one for one in box.link.states(box.now) if one.name == name)


def way(box: Box) -> str:
    return state(box).way


def dance(box: Box, sensor: Wearable, seconds: float, origin: tuple[str, int] = A) -> list[wire.Packet]:
    """Readings at 50 Hz; what the box sent meanwhile."""
    heard = []
    for _ in range(round(50 * seconds)):
        box.now += 0.02
        assert len(box.hear(sensor.reading(), origin=origin)) == 1
        for data, to in box.answers():
            if data[4] == sensor.key.device_id:
                assert to == origin
                heard.append(sensor.hear(data))
    return heard
