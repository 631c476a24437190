"""Streaming ACN (ANSI E1.31-2018): data packets and universe discovery, packed into one buffer."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from uuid import UUID

DISCOVERY_UNIVERSE = 64214
PREVIEW = 0x80  # options, E1.31 section 6.2.6
TERMINATED = 0x40
_MOST_UNIVERSES_A_PAGE = 512

_PREAMBLE = struct.pack(">HH12s", 0x0010, 0x0000, b"ASC-E1.17")  # section 5.1 to 5.3
_ROOT_DATA, _ROOT_EXTENDED = 4, 8  # vectors, appendix A
_FRAME_DATA, _FRAME_DISCOVERY = 2, 2
_DMP_SET_PROPERTY, _ADDRESS_AND_DATA_TYPE = 0x02, 0xA1
_UNIVERSE_LIST = 1
_FRAMING, _DMP, _LIST = 38, 115, 112  # where the layers begin
_PRIORITY, _SEQUENCE, _OPTIONS, _DATA = 108, 111, 112, 126
HIGHEST_PRIORITY = 200  # section 6.2.3


def group(universe: int) -> str:
    """The multicast address of a universe (section 9.3.1)."""
    return f"239.255.{universe >> 8}.{universe & 0xFF}"


def _flags_and_length(octets: int) -> int:
    """The length that counts from its own field on, under flags 0x7 (section 4.1)."""
    return 0x7000 | octets


def source_field(name: str) -> bytes:
    """A source's name in 64 octets: UTF-8, cut between characters, zero-terminated (section 6.2.2)."""
    return name.encode()[:63].decode(errors="ignore").encode().ljust(64, b"\0")


class DataPackets:
    """The packets of one universe from one source."""

    def __init__(
        self,
        cid: UUID,
        name: str,
        universe: int,
        channels: int,
        *,
        priority: int = 100,
        preview: bool = False,
    ) -> None:
        self._channels = channels
        self._options = PREVIEW if preview else 0
        self._sequence = -1
        total = _DATA + channels
        self._packet = bytearray(total)
        root = struct.pack(">HI16s", _flags_and_length(total - 16), _ROOT_DATA, cid.bytes)
        framing = struct.pack(
            ">HI64sBHBBH",
            *(_flags_and_length(total - _FRAMING), _FRAME_DATA, source_field(name), priority),
            *(0, 0, 0, universe),  # no synchronisation; sequence and options follow with each packet
        )
        dmp = struct.pack(
            ">HBBHHHB",
            *(_flags_and_length(total - _DMP), _DMP_SET_PROPERTY, _ADDRESS_AND_DATA_TYPE),
            *(0, 1, channels + 1, 0),  # start code 0: levels
        )
        header = _PREAMBLE + root + framing + dmp
        self._packet[: len(header)] = header

    def pack(self, data: bytes | bytearray) -> bytearray:
        """The next packet; valid until the next call."""
        self._packet[_DATA:] = data[: self._channels]
        return self._number(self._options)

    def rank(self, priority: int) -> None:
        """Receivers take the source with the highest priority, from the next packet on."""
        self._packet[_PRIORITY] = min(priority, HIGHEST_PRIORITY)

    def terminate(self) -> bytearray:
        """The next packet, which terminates this source's stream; receivers ignore its levels."""
        return self._number(self._options | TERMINATED)

    def _number(self, options: int) -> bytearray:
        self._sequence = self._sequence + 1 & 0xFF
        self._packet[_SEQUENCE] = self._sequence
        self._packet[_OPTIONS] = options
        return self._packet


def discovery(cid: UUID, name: str, universes: Iterable[int]) -> bytes:
    """The one page of a source's universe list (section 8); a box has far fewer than 512."""
    numbers = sorted(set(universes))[:_MOST_UNIVERSES_A_PAGE]
    total = _LIST + 8 + 2 * len(numbers)
    root = struct.pack(">HI16s", _flags_and_length(total - 16), _ROOT_EXTENDED, cid.bytes)
    framing = struct.pack(
        ">HI64sI", _flags_and_length(total - _FRAMING), _FRAME_DISCOVERY, source_field(name), 0
    )
    listed = struct.pack(
        f">HIBB{len(numbers)}H", _flags_and_length(total - _LIST), _UNIVERSE_LIST, 0, 0, *numbers
    )
    return _PREAMBLE + root + framing + listed
