"""Art-Net 4: one universe as an ArtDmx packet, to a node's address or as a broadcast."""

from __future__ import annotations

import struct

from appliance.outputs.datagram_sender import DatagramPath
from appliance.outputs.dmx.network_wire import NetworkWire
from appliance.show.dmx import DmxConfig

PORT = 6454  # at both ends: some nodes take nothing from another one
ID = b"Art-Net\0"
_OP_DMX, _OP_ADDRESS = 0x5000, 0x6000
_KEEP, _CANCEL_MERGE = 0x7F, 0x01  # ArtAddress: leave as it is; AcCancelMerge
PROTOCOL_VERSION = 14
_SEQUENCE = 12  # offsets in the packet
_DATA = 18


class ArtDmx:
    """ArtDmx packets of one port address, packed into one buffer (Art-Net 4, 'ArtDmx packet definition')."""

    def __init__(self, port_address: int, channels: int) -> None:
        self._channels = channels
        length = channels + channels % 2  # even
        self._packet = bytearray(_DATA + length)
        # Low byte of the port address first (subnet and universe), then net: little-endian in 15 bits.
        struct.pack_into("<8sH", self._packet, 0, ID, _OP_DMX)
        struct.pack_into(">H", self._packet, 10, PROTOCOL_VERSION)
        struct.pack_into("<H", self._packet, 14, port_address)
        struct.pack_into(">H", self._packet, 16, length)
        self._sequence = 0

    def pack(self, data: bytes | bytearray) -> bytearray:
        """The next packet; valid until the next call."""
        self._sequence = self._sequence % 255 + 1  # 1..255; 0 would mean unnumbered
        self._packet[_SEQUENCE] = self._sequence
        self._packet[_DATA : _DATA + self._channels] = data[: self._channels]
        return self._packet


def cancel_merge() -> bytes:
    """ArtAddress that changes nothing of a node, and ends its merge: it takes the next ArtDmx only."""
    switches = bytes([_KEEP] * 9 + [255, _CANCEL_MERGE])  # input, output, sub-net; sACN priority; command
    head = struct.pack("<8sH", ID, _OP_ADDRESS) + struct.pack(">HBB", PROTOCOL_VERSION, _KEEP, 1)
    return head + bytes(18 + 64) + switches


class ArtNetWire(NetworkWire):
    """One universe to one node, or to all of a network. Unchanged data is repeated by the pace."""

    def __init__(self, config: DmxConfig) -> None:
        host = config.host or "127.0.0.1"
        super().__init__(
            f"Art-Net {host}, universe {config.number_on_wire}",
            DatagramPath(host, config.udp_port, config.interface, config.broadcast, source_port=PORT),
            "Check the node's power, its network cable, and its address in the box file.",
        )
        self._packets = ArtDmx(config.number_on_wire, config.channels)

    def take_over(self, raised: int, now: float) -> None:
        """Another box was the source until now: the node is to forget that one's levels."""
        self.send_datagrams((cancel_merge(),), now)

    def send_universe(self, levels: bytes | bytearray, now: float) -> None:
        self.send_datagrams((self._packets.pack(levels),), now)
