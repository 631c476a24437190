"""A decoder of streaming ACN (ANSI E1.31-2018): data and universe discovery, each field looked at."""

from __future__ import annotations

from dataclasses import dataclass
from uuid import UUID

PORT = 5568
DISCOVERY_UNIVERSE = 64214
_IDENTIFIER = bytes.fromhex("41 53 43 2d 45 31 2e 31 37 00 00 00")  # section 5.3


class MalformedSacnError(ValueError):
    """Bytes that E1.31 does not know; the message says what is wrong."""


@dataclass(frozen=True)
class Data:
    """One data packet: source, priority, levels, and whether it terminates the stream."""

    cid: UUID
    source_name: str
    priority: int
    synchronisation: int
    sequence: int
    preview: bool
    terminated: bool
    universe: int
    start_code: int
    levels: bytes


@dataclass(frozen=True)
class Discovery:
    """One page of a source's universes."""

    cid: UUID
    source_name: str
    page: int
    last_page: int
    universes: tuple[int, ...]


def decode(datagram: bytes) -> Data | Discovery:
    """Read one datagram. Raises MalformedSacnError."""
    layer = _root(datagram)
    vector = _number(datagram, 18, 4)
    cid = UUID(bytes=datagram[22:38])
    _length(datagram, 38, layer)
    if vector == 0x00000004:  # VECTOR_ROOT_E131_DATA
        return _data(datagram, cid)
    if vector == 0x00000008:  # VECTOR_ROOT_E131_EXTENDED
        return _discovery(datagram, cid)
    raise MalformedSacnError(f"root vector {vector} is unknown")


def _root(datagram: bytes) -> int:
    """Where the packet ends; section 5."""
    if len(datagram) < 120:
        raise MalformedSacnError(f"{len(datagram)} octets are too few")
    if _number(datagram, 0, 2) != 0x0010 or _number(datagram, 2, 2) != 0:
        raise MalformedSacnError("preamble or postamble is wrong")
    if datagram[4:16] != _IDENTIFIER:
        raise MalformedSacnError("it is no ACN packet")
    return _length(datagram, 16, len(datagram))


def _length(datagram: bytes, start: int, end: int) -> int:
    """A layer's flags and length have to reach from its start to the packet's end."""
    field = _number(datagram, start, 2)
    if field >> 12 != 0x7:
        raise MalformedSacnError(f"the flags at octet {start} are {field >> 12:#x}, not 0x7")
    if start + (field & 0x0FFF) != end:
        raise MalformedSacnError(f"the layer at octet {start} ends at {start + (field & 0xFFF)}, not {end}")
    return end


def _data(datagram: bytes, cid: UUID) -> Data:
    """Sections 6 and 7."""
    if _number(datagram, 40, 4) != 0x00000002:  # VECTOR_E131_DATA_PACKET
        raise MalformedSacnError("the framing vector is not that of data")
    _length(datagram, 115, len(datagram))
    if tuple(datagram[117:123]) != (0x02, 0xA1, 0, 0, 0, 1):
        raise MalformedSacnError("the DMP layer's vector, type, first address or increment is wrong")
    count = _number(datagram, 123, 2)
    if not 1 <= count <= 513 or len(datagram) != 125 + count:
        raise MalformedSacnError(f"{count} properties are said, {len(datagram) - 125} follow")
    priority, universe, options = datagram[108], _number(datagram, 113, 2), datagram[112]
    if priority > 200:
        raise MalformedSacnError(f"priority {priority} is more than 200")
    if not 1 <= universe <= 63999:
        raise MalformedSacnError(f"universe {universe} is not 1 to 63999")
    return Data(
        cid=cid,
        source_name=_name(datagram),
        priority=priority,
        synchronisation=_number(datagram, 109, 2),
        sequence=datagram[111],
        preview=bool(options & 0x80),
        terminated=bool(options & 0x40),
        universe=universe,
        start_code=datagram[125],
        levels=datagram[126:],
    )


def _discovery(datagram: bytes, cid: UUID) -> Discovery:
    """Section 8."""
    if _number(datagram, 40, 4) != 0x00000002:  # VECTOR_E131_EXTENDED_DISCOVERY
        raise MalformedSacnError("the framing vector is not that of discovery")
    _length(datagram, 112, len(datagram))
    if _number(datagram, 114, 4) != 0x00000001:  # VECTOR_UNIVERSE_DISCOVERY_UNIVERSE_LIST
        raise MalformedSacnError("the list's vector is wrong")
    listed = datagram[120:]
    universes = tuple(_number(listed, place, 2) for place in range(0, len(listed), 2))
    if len(universes) > 512 or list(universes) != sorted(set(universes)):
        raise MalformedSacnError("the universes are too many or not in order")
    return Discovery(cid, _name(datagram), datagram[118], datagram[119], universes)


def _name(datagram: bytes) -> str:
    """The source's name, which has to be ended by a zero (section 6.2.2)."""
    text, ended, _ = datagram[44:108].partition(b"\0")
    if not ended:
        raise MalformedSacnError("the source's name is not ended by a zero")
    try:
        return text.decode("utf-8")
    except UnicodeDecodeError:
        raise MalformedSacnError("the source's name is not UTF-8") from None


def _number(datagram: bytes, start: int, octets: int) -> int:
    return int.from_bytes(datagram[start : start + octets], "big")
