"""The packets between wearable and box: the one declaration that everything else is generated from.

Little-endian, fixed size, one packet a datagram, an 8-byte keyed BLAKE2s tag at the end of each. The tables
of docs/wire.md, the firmware's wire.h and the golden vectors come from `python -m tools.generate_wire`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, fields
from hashlib import blake2s
from hmac import compare_digest
from typing import Annotated, Any, get_type_hints

MAGIC = 0x4B42  # the bytes "BK" on the wire
VERSION = 1
KEY_BYTES = 16
TAG_BYTES = 8
Q14 = 1 << 14  # the scale of quaternions: 16384 stands for 1.0
BATTERY_UNKNOWN = 255
ROUND_TRIP_UNKNOWN = 0xFFFF
LED_OFF, LED_ON, LED_SLOW, LED_FAST, LED_STROBE = range(5)
HAS_PROFILE, IS_NDOF, RADIO_IS_OLD, HAS_CRYSTAL = 1, 2, 4, 8  # bits of `flags` in hello and reading
SIGNAL_SHIFT, MOST_STEPS, WEAKEST_DBM, DBM_A_STEP = 4, 15, -90, 4  # and its upper four bits
Buffer = bytes | bytearray | memoryview


class WireError(ValueError):
    """A datagram that is not a packet for us; `reason` is one word for a counter."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"not a packet for this box: {reason}")
        self.reason = reason


@dataclass(frozen=True)
class Coding:
    """Encoding of one field: struct code, C type, number of values, and the value of 1.0."""

    code: str
    c_type: str
    count: int = 1
    scale: int = 1

    @property
    def size(self) -> int:
        return struct.calcsize("<" + self.code * self.count)


U8, U16, U32 = Coding("B", "uint8_t"), Coding("H", "uint16_t"), Coding("I", "uint32_t")
QUATERNION = Coding("h", "int16_t", count=4, scale=Q14)
IDENTITY16 = Coding("16s", "uint8_t[16]")
OFFSETS22 = Coding("22s", "uint8_t[22]")
LEDS = "0 off, 1 on, 2 slow, 3 fast, 4 strobe"
FLAGS = (
    "bit 0: a calibration profile is in use; bit 1: fusion with the magnetometer (NDOF); bit 2: the radio's "
    "own firmware is older than 19.5.4; bit 3: the IMU runs by a crystal; bits 4 to 7: n > 0: the Wi-Fi had "
    "4 n - 90 dBm when it was joined"
)


@dataclass(slots=True)
class Packet:
    """The fields of every packet after magic, version and kind."""

    device_id: Annotated[int, U32, "which sensor, as in the key file"]
    boot_nonce: Annotated[int, U32, "random, drawn by the sensor at each power-on"]
    session: Annotated[int, U32, "given by the box to this power-on, by a hash with its secret; 0 before one"]
    sequence: Annotated[
        int, U32, "counts this kind of packet from this sender to this receiver, since its start"
    ]


@dataclass(slots=True)
class Hello(Packet):
    """The sensor is on and looks for its box: every 500 ms on network and cable, broadcast on Wi-Fi."""

    wire_hash: Annotated[int, U32, "hash of this declaration; a mismatch means that one side needs an update"]
    firmware_major: Annotated[int, U8, "firmware version"]
    firmware_minor: Annotated[int, U8, ""]
    firmware_patch: Annotated[int, U8, ""]
    battery: Annotated[int, U8, "percent; 255 unknown"]
    flags: Annotated[int, U8, FLAGS]
    imu_id: Annotated[bytes, IDENTITY16, "unique id of the IMU; its calibration is kept under it"]


@dataclass(slots=True)
class Assignment(Packet):
    """The box takes the sensor, which then streams to the sender of this packet. Bound to one hello."""

    hello_sequence: Annotated[int, U32, "sequence of the hello that it answers"]
    hand: Annotated[int, U8, "which hand of the show, from 0; 255 none"]
    rate_hz: Annotated[int, U8, "readings a second"]
    led: Annotated[int, U8, LEDS]


@dataclass(slots=True)
class Reading(Packet):
    """One orientation of the sensor, at the rate of the assignment: 50 or 100 a second."""

    sensor_time_us: Annotated[int, U32, "device clock at the measurement; wraps after 71.6 minutes"]
    orientation: Annotated[
        tuple[float, float, float, float],
        QUATERNION,
        "w, x, y, z; 16384 stands for 1; from the case to the room",
    ]
    calibration: Annotated[
        int, U8, "system, gyroscope, accelerometer, magnetometer: two bits each, 3 is best"
    ]
    battery: Annotated[int, U8, "percent; 255 unknown"]
    round_trip: Annotated[int, U16, "newest round trip by a heartbeat's echo, 0.1 ms; 65535 unknown"]
    taps: Annotated[int, U8, "counts double taps since power-on; wraps"]
    recoveries: Annotated[int, U8, "counts restarts of the fusion since power-on; wraps; its heading is lost"]
    flags: Annotated[int, U8, FLAGS]


@dataclass(slots=True)
class Heartbeat(Packet):
    """The box is there: every second, and at once when the light changes. After three seconds without it the
    sensor sends hellos again.
    """

    echo_sequence: Annotated[int, U32, "sequence of the newest reading that arrived"]
    echo_held_us: Annotated[int, U32, "how long the box held that reading before this packet left"]
    led: Annotated[int, U8, LEDS]


@dataclass(slots=True)
class Call(Packet):
    """The box does not know the session of a reading, because it was restarted: send a hello at once."""


@dataclass(slots=True)
class Profile(Packet):
    """A calibration that the sensor has learned, for the box to keep: an update erases the sensor's copy."""

    imu_id: Annotated[bytes, IDENTITY16, "unique id of the IMU"]
    offsets: Annotated[bytes, OFFSETS22, "as the IMU has it; the box does not look inside"]


@dataclass(slots=True)
class Restore(Packet):
    """A kept calibration for a sensor that has none, with the first five heartbeats."""

    imu_id: Annotated[bytes, IDENTITY16, "unique id of the IMU that it is for"]
    offsets: Annotated[bytes, OFFSETS22, "as that IMU gave it"]


def signal_dbm(flags: int) -> int | None:
    """How strong a wearable's Wi-Fi was when it was joined; None where it does not say."""
    steps = flags >> SIGNAL_SHIFT
    return WEAKEST_DBM + DBM_A_STEP * steps if steps else None


class Layout:
    """One packet's bytes, compiled from its declaration: magic, version, kind, fields in order, tag."""

    def __init__(self, kind: int, direction: str, packet: type[Packet]) -> None:
        self.kind = kind
        self.direction = direction
        self.packet: Callable[..., Packet] = packet
        self.name = packet.__name__
        self.meaning = " ".join((packet.__doc__ or "").split())
        hints = get_type_hints(packet, include_extras=True)
        self.fields: list[tuple[str, Coding, str]] = [
            (field.name, *hints[field.name].__metadata__) for field in fields(packet)
        ]
        codes = (
            f"{coding.count}{coding.code}" if coding.count > 1 else coding.code
            for _, coding, _ in self.fields
        )
        self._struct = struct.Struct("<HBB" + "".join(codes))
        self.signed_bytes = self._struct.size
        self.size = self.signed_bytes + TAG_BYTES

    def encode(self, packet: Packet) -> bytes:
        """The packet's bytes without the tag. Raises struct.error when a value does not fit its field."""
        values: list[Any] = [MAGIC, VERSION, self.kind]
        for name, coding, _ in self.fields:
            value = getattr(packet, name)
            if coding.count == 1:
                values.append(value)
            else:
                values += (round(part * coding.scale) for part in value)
        return self._struct.pack(*values)

    def decode(self, data: Buffer) -> Packet:
        """The packet in `data`; length, magic, kind and tag were checked before."""
        values = self._struct.unpack_from(data)
        arguments: list[Any] = []
        at = 3
        for _, coding, _ in self.fields:
            if coding.count == 1:
                arguments.append(values[at])
            else:
                arguments.append(tuple([part / coding.scale for part in values[at : at + coding.count]]))
            at += coding.count
        return self.packet(*arguments)


LAYOUTS = {
    layout.kind: layout
    for layout in (
        Layout(1, "sensor to box", Hello),
        Layout(2, "box to sensor", Assignment),
        Layout(3, "sensor to box", Reading),
        Layout(4, "box to sensor", Heartbeat),
        Layout(5, "box to sensor", Call),
        Layout(6, "sensor to box", Profile),
        Layout(7, "box to sensor", Restore),
    )
}
_BY_NAME = {layout.name: layout for layout in LAYOUTS.values()}
READING = _BY_NAME["Reading"]
LARGEST = max(layout.size for layout in LAYOUTS.values())
HEAD = struct.Struct("<HBBIIII")  # magic, version, kind and the fields of Packet


class Tagger:
    """Signs and verifies with one sensor's key: BLAKE2s, keyed, 8 bytes of output, no salt, no person."""

    def __init__(self, key: bytes) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"a sensor's key has {KEY_BYTES} bytes, not {len(key)}")
        self._keyed = blake2s(key=key, digest_size=TAG_BYTES)

    def tag(self, signed: Buffer) -> bytes:
        keyed = self._keyed.copy()
        keyed.update(signed)
        return keyed.digest()

    def is_authentic(self, data: Buffer) -> bool:
        """Whether the last 8 bytes of `data` are the tag of those before; in constant time."""
        return compare_digest(self.tag(data[:-TAG_BYTES]), data[-TAG_BYTES:])


def pack(packet: Packet, tagger: Tagger) -> bytes:
    """One datagram: the packet and its tag. Raises struct.error when a value does not fit its field."""
    signed = _BY_NAME[type(packet).__name__].encode(packet)
    return signed + tagger.tag(signed)


def read_head(data: Buffer) -> tuple[Layout, tuple[int, int, int, int]] | str:
    """Layout, and device id, boot nonce, session, sequence; or in one word why this is no packet."""
    if len(data) < HEAD.size:
        return "length"
    magic, version, kind, *head = HEAD.unpack_from(data)
    if magic != MAGIC:
        return "magic"
    if version != VERSION:
        return "version"
    layout = LAYOUTS.get(kind)
    if layout is None:
        return "kind"
    device_id, boot_nonce, session, sequence = head
    return (layout, (device_id, boot_nonce, session, sequence)) if len(data) == layout.size else "length"


def unpack(data: Buffer, tagger_of: Callable[[int], Tagger | None]) -> Packet:
    """The packet in one datagram; `tagger_of` gives a device's key, or None for an unknown device.

    Raises WireError with the reason length, magic, version, kind, device or tag, and nothing else.
    """
    found = read_head(data)
    if isinstance(found, str):
        raise WireError(found)
    layout, head = found
    tagger = tagger_of(head[0])
    if tagger is None:
        raise WireError("device")
    if not tagger.is_authentic(data):
        raise WireError("tag")
    return layout.decode(data)


def declaration() -> str:
    """The wire format on which both sides must agree, as text: order, names, types, scales, kinds, tag."""
    lines = [f"magic={MAGIC:#06x} version={VERSION} tag=blake2s-{TAG_BYTES} key={KEY_BYTES}"]
    for layout in LAYOUTS.values():
        lines.append(f"{layout.kind} {layout.name} {layout.direction} {layout.size}")
        lines += [
            f"  {name} {coding.c_type} {coding.count} {coding.scale}" for name, coding, _ in layout.fields
        ]
    return "\n".join(lines)


WIRE_HASH = int.from_bytes(blake2s(declaration().encode(), digest_size=4).digest(), "little")
