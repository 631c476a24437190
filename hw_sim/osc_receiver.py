"""An OSC receiver that decodes by itself: the peer that the box's outputs are checked against."""

from __future__ import annotations

import select
import socket
import struct
import time
from types import TracebackType

from hw_sim.receive_buffer import widen

Argument = int | float | str | bytes | bool | None
Received = tuple[float, str, list[Argument]]

_NUMBERS = {"i": ">i", "f": ">f", "h": ">q", "d": ">d", "t": ">Q"}
_CONSTANTS: dict[str, Argument] = {"T": True, "F": False, "N": None, "I": float("inf")}
_BUNDLE = b"#bundle\0"
_DEEPEST_BUNDLE = 8
RECEIVE_BUFFER_BYTES = 4 << 20  # seconds of frames: a slow reader loses none, so what is missing was not sent


class MalformedOscError(ValueError):
    """Bytes that are not OSC 1.0; the message says what is wrong where."""


class OscReceiver:
    """Listens on a UDP port; `poll` hands out messages with the time at which each datagram was received.

    arrival: seconds on the monotonic clock, read right after the datagram. All messages of one datagram
    share it. datagrams, malformed: how many came in, and how many of them could not be decoded.
    """

    def __init__(self, host: str, port: int = 0) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        widen(self._socket, RECEIVE_BUFFER_BYTES)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self.host = host
        self.port: int = self._socket.getsockname()[1]
        self.datagrams = 0
        self.malformed = 0

    def poll(self, timeout: float = 0.0) -> list[Received]:
        """Wait up to `timeout` seconds, then take all that is there: (arrival, address, arguments)."""
        return [
            (arrival, address, arguments)
            for arrival, datagram in self.poll_datagrams(timeout)
            for address, arguments in self._decoded(datagram)
        ]

    def poll_datagrams(self, timeout: float = 0.0) -> list[tuple[float, bytes]]:
        """The same, undecoded: decoding can wait while timing matters."""
        received: list[tuple[float, bytes]] = []
        select.select([self._socket], [], [], timeout)
        while True:
            try:
                datagram = self._socket.recv(65536)
            except BlockingIOError:
                break
            received.append((time.monotonic(), datagram))
        self.datagrams += len(received)
        return received

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def __enter__(self) -> OscReceiver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _decoded(self, datagram: bytes) -> list[tuple[str, list[Argument]]]:
        try:
            return decode(datagram)
        except MalformedOscError:
            self.malformed += 1
            return []


def decode(packet: bytes, depth: int = 0) -> list[tuple[str, list[Argument]]]:
    """Messages of a packet, bundles opened, in their order; raises MalformedOscError."""
    if not packet.startswith(_BUNDLE):
        return [_message(packet)]
    if depth == _DEEPEST_BUNDLE:
        raise MalformedOscError("bundles within bundles within bundles")
    if len(packet) < 16:
        raise MalformedOscError("a bundle without its time tag")
    messages: list[tuple[str, list[Argument]]] = []
    at = 16
    while at < len(packet):
        size, at = _number(packet, at, "i")
        if not isinstance(size, int) or size < 0 or size % 4 or at + size > len(packet):
            raise MalformedOscError(f"an element of {size} bytes at byte {at} of {len(packet)}")
        messages += decode(packet[at : at + size], depth + 1)
        at += size
    return messages


def _message(packet: bytes) -> tuple[str, list[Argument]]:
    address, at = _string(packet, 0)
    if not address.startswith("/"):
        raise MalformedOscError(f"the address {address!r} does not start with a slash")
    tags, at = _string(packet, at)
    if not tags.startswith(","):
        raise MalformedOscError(f"the type tags {tags!r} do not start with a comma")
    arguments: list[Argument] = []
    for tag in tags[1:]:
        value, at = _argument(packet, at, tag)
        arguments.append(value)
    if at != len(packet):
        raise MalformedOscError(f"{len(packet) - at} bytes too many behind {address}")
    return address, arguments


def _argument(packet: bytes, at: int, tag: str) -> tuple[Argument, int]:
    if tag in _NUMBERS:
        return _number(packet, at, tag)
    if tag in _CONSTANTS:
        return _CONSTANTS[tag], at
    if tag in "sS":
        return _string(packet, at)
    if tag == "b":
        return _blob(packet, at)
    raise MalformedOscError(f"unknown type tag {tag!r}")


def _number(packet: bytes, at: int, tag: str) -> tuple[int | float, int]:
    layout = _NUMBERS[tag]
    end = at + struct.calcsize(layout)
    if end > len(packet):
        raise MalformedOscError(f"the packet ends within a number at byte {at}")
    value: int | float = struct.unpack(layout, packet[at:end])[0]
    return value, end


def _string(packet: bytes, at: int) -> tuple[str, int]:
    end = packet.find(b"\0", at)
    if end < 0:
        raise MalformedOscError(f"a string without an end at byte {at}")
    after = at + (end - at) // 4 * 4 + 4
    if after > len(packet) or packet[end:after].strip(b"\0"):
        raise MalformedOscError(f"a string that is not filled up with zeros at byte {at}")
    try:
        return packet[at:end].decode("ascii"), after
    except UnicodeDecodeError:
        raise MalformedOscError(f"a string that is not ASCII at byte {at}") from None


def _blob(packet: bytes, at: int) -> tuple[bytes, int]:
    size, at = _number(packet, at, "i")
    if not isinstance(size, int) or size < 0 or at + size > len(packet):
        raise MalformedOscError(f"a blob of {size} bytes at byte {at} of {len(packet)}")
    after = at + -(-size // 4) * 4
    if after > len(packet) or packet[at + size : after].strip(b"\0"):
        raise MalformedOscError(f"a blob that is not filled up with zeros at byte {at}")
    return packet[at : at + size], after
