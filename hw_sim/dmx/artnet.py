"""An Art-Net 4 receiver that decodes by itself: the peer that the box's universes are checked against."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from hw_sim.dmx.datagrams import DatagramReceiver

PORT = 6454
OP_DMX = 0x5000
OLDEST_VERSION = 14
MOST_CHANNELS = 512


class MalformedArtNetError(ValueError):
    """Bytes that are no ArtDmx packet; the message says what is wrong."""


@dataclass(frozen=True)
class ArtDmx:
    """One ArtDmx packet: sequence 1..255 (0: unnumbered), port address in 15 bits, levels."""

    sequence: int
    physical: int
    port_address: int
    levels: bytes

    @property
    def net(self) -> int:
        """Bits 14 to 8 of the port address."""
        return self.port_address >> 8

    @property
    def subnet(self) -> int:
        """Bits 7 to 4."""
        return self.port_address >> 4 & 0x0F

    @property
    def universe(self) -> int:
        """Bits 3 to 0."""
        return self.port_address & 0x0F


def decode(datagram: bytes) -> ArtDmx:
    """Read one datagram (Art-Net 4, table of the ArtDmx packet). Raises MalformedArtNetError."""
    if len(datagram) < 20:
        raise MalformedArtNetError(f"{len(datagram)} octets are too few for ArtDmx")
    if datagram[:8] != b"Art-Net\0":
        raise MalformedArtNetError("it does not begin with Art-Net")
    operation = int.from_bytes(datagram[8:10], "little")
    if operation != OP_DMX:
        raise MalformedArtNetError(f"operation {operation:#06x} is not ArtDmx")
    version, sequence, physical, low, high, length = struct.unpack(">HBBBBH", datagram[10:18])
    if version < OLDEST_VERSION:
        raise MalformedArtNetError(f"protocol version {version} is too old")
    if high > 0x7F:
        raise MalformedArtNetError(f"net {high} has more than 7 bits")
    if length % 2 or not 2 <= length <= MOST_CHANNELS:
        raise MalformedArtNetError(f"length {length} is odd or not 2 to {MOST_CHANNELS}")
    if len(datagram) != 18 + length:
        raise MalformedArtNetError(f"length says {length}, but {len(datagram) - 18} levels follow")
    return ArtDmx(sequence, physical, high << 8 | low, datagram[18:])


class ArtNetReceiver(DatagramReceiver[ArtDmx]):
    """Listens on a UDP port; `poll` hands out what has come, with its arrival (monotonic seconds)."""

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(decode, MalformedArtNetError, host, port)
