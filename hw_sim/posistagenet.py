"""A PosiStageNet 2 receiver that decodes by itself, written from the protocol's description v2.03."""

from __future__ import annotations

import ipaddress
import socket
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import TracebackType

from hw_sim.receive_buffer import widen

GROUP, PORT = "236.10.10.10", 56565
MAX_PACKET = 1500
RECEIVE_BUFFER_BYTES = 4 << 20  # seconds of frames: a slow reader loses none, so what is missing was not sent

Vector = tuple[float, float, float]

_VECTORS = {0: "position", 1: "speed", 2: "orientation", 4: "acceleration", 5: "target"}


class MalformedPsnError(ValueError):
    """Bytes that are not PosiStageNet 2; the message says what is wrong where."""


@dataclass
class Tracker:
    """One point in space, as the packet has it: metres, seconds, radians."""

    position: Vector | None = None
    speed: Vector | None = None
    orientation: Vector | None = None
    acceleration: Vector | None = None
    target: Vector | None = None
    status: float | None = None
    timestamp_us: int | None = None


@dataclass
class Packet:
    """One packet: `trackers` of a data packet, `system` and `names` of an information packet."""

    is_data: bool
    time_us: int
    version: tuple[int, int]
    frame: int
    packets: int  # in this frame
    trackers: dict[int, Tracker] = field(default_factory=dict)
    system: str = ""
    names: dict[int, str] = field(default_factory=dict)


def decode(datagram: bytes) -> Packet:
    """A whole packet; chunks that the protocol does not name are passed over. Raises MalformedPsnError."""
    if len(datagram) > MAX_PACKET:
        raise MalformedPsnError(f"a packet of {len(datagram)} bytes")
    chunks = list(_chunks(datagram, "the packet"))
    if len(chunks) != 1 or chunks[0][0] not in (0x6755, 0x6756):
        raise MalformedPsnError("neither one data packet nor one information packet")
    is_data = chunks[0][0] == 0x6755
    inner = list(_children(chunks[0], "the packet"))
    headers = [data for number, data, _ in inner if number == 0]
    if len(headers) != 1 or len(headers[0]) < 12:
        raise MalformedPsnError("a packet without one header")
    time_us, high, low, frame, packets = struct.unpack("<QBBBB", headers[0][:12])
    packet = Packet(is_data, time_us, (high, low), frame, packets)
    for chunk in inner:
        if is_data and chunk[0] == 1:
            for tracker in _children(chunk, "the tracker list"):
                packet.trackers[tracker[0]] = _tracker(tracker)
        elif not is_data and chunk[0] == 1:
            packet.system = chunk[1].decode()
        elif not is_data and chunk[0] == 2:
            for tracker in _children(chunk, "the tracker list"):
                for number, data, _ in _children(tracker, f"tracker {tracker[0]}"):
                    if number == 0:
                        packet.names[tracker[0]] = data.decode()
    return packet


class PsnReceiver:
    """Joins the group on one interface (or listens on an own address); hands out what came, decoded.

    datagrams, malformed: how many came in, and how many of them could not be decoded.
    """

    def __init__(self, interface: str, group: str = GROUP, port: int = PORT) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        widen(self._socket, RECEIVE_BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((group, port))
            if ipaddress.IPv4Address(group).is_multicast:
                membership = socket.inet_aton(group) + socket.inet_aton(interface)
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError:
            self._socket.close()
            raise
        self.port: int = self._socket.getsockname()[1]
        self.datagrams = 0
        self.malformed = 0

    def poll(self, timeout: float = 0.0) -> list[Packet]:
        """Wait up to `timeout` seconds for the first one, then take all that is there."""
        return [packet for datagram in self.poll_datagrams(timeout) for packet in self._decoded(datagram)]

    def poll_datagrams(self, timeout: float = 0.0) -> list[bytes]:
        """The same, undecoded."""
        received: list[bytes] = []
        self._socket.settimeout(timeout)
        try:
            while True:
                received.append(self._socket.recv(65536))
                self._socket.settimeout(0.0)
        except (TimeoutError, BlockingIOError):
            self.datagrams += len(received)
            return received

    def close(self) -> None:
        """Leave the group."""
        self._socket.close()

    def __enter__(self) -> PsnReceiver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _decoded(self, datagram: bytes) -> list[Packet]:
        try:
            return [decode(datagram)]
        except (MalformedPsnError, UnicodeDecodeError):
            self.malformed += 1
            return []


_Chunk = tuple[int, bytes, bool]  # id, data, whether that is chunks again


def _chunks(data: bytes, where: str) -> Iterator[_Chunk]:
    """Chunk after chunk. Header: 16 bits of id, 15 of length, the last one says that chunks are inside."""
    at = 0
    while at < len(data):
        if at + 4 > len(data):
            raise MalformedPsnError(f"{len(data) - at} bytes too many in {where}")
        (header,) = struct.unpack_from("<I", data, at)
        length = (header >> 16) & 0x7FFF
        if at + 4 + length > len(data):
            raise MalformedPsnError(f"a chunk of {length} bytes at byte {at} of {len(data)} in {where}")
        yield header & 0xFFFF, data[at + 4 : at + 4 + length], bool(header >> 31)
        at += 4 + length


def _children(chunk: _Chunk, where: str) -> Iterator[_Chunk]:
    if not chunk[2]:
        raise MalformedPsnError(f"{where} does not say that chunks are inside")
    return _chunks(chunk[1], where)


def _tracker(chunk: _Chunk) -> Tracker:
    tracker, where = Tracker(), f"tracker {chunk[0]}"
    for number, data, _ in _children(chunk, where):
        try:
            if number in _VECTORS:
                setattr(tracker, _VECTORS[number], struct.unpack("<fff", data[:12]))
            elif number == 3:
                (tracker.status,) = struct.unpack("<f", data[:4])
            elif number == 6:
                (tracker.timestamp_us,) = struct.unpack("<Q", data[:8])
        except struct.error:
            raise MalformedPsnError(f"a field {number} of {len(data)} bytes in {where}") from None
    return tracker
