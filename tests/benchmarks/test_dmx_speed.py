"""Universes on their way to the lights: packed by hand against the sacn library and against plain Python."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any
from uuid import UUID

import pytest
from sacn.messages.data_packet import DataPacket

from appliance.outputs.dmx.art_net import ArtDmx
from appliance.outputs.dmx.open_wire import open_universes
from appliance.outputs.dmx.sacn_packet import DataPackets
from hw_sim.dmx.artnet import ArtNetReceiver
from tests.outputs.dmx.conftest import config, universe

SACN_GROUP = "one universe packed into sACN"
ART_NET_GROUP = "one universe packed into Art-Net"
SENT_GROUP = "two universes to two sockets"
CID = UUID("00112233-4455-6677-8899-aabbccddeeff")


def test_sacn_library(measured: Callable[..., Any]) -> None:
    packet = DataPacket(tuple(CID.bytes), "A box", 7, tuple(universe()))

    def pack() -> bytes:
        packet.dmxData = tuple(universe_now)
        packet.sequence_increase()
        return bytes(packet.getBytes())

    universe_now = universe(1)
    theirs = measured("the sacn library", SACN_GROUP, reference=True)(pack)
    ours = bytearray(DataPackets(CID, "A box", 7, 512).pack(universe_now))
    ours[111] = theirs[111]  # the sequence: the benchmark has packed many
    assert theirs == bytes(ours)


def test_sacn(measured: Callable[..., Any]) -> None:
    packets, data = DataPackets(CID, "A box", 7, 512), universe(1)
    assert len(measured("ours", SACN_GROUP)(packets.pack, data)) == 638


def pack_as_textbooks_do(port_address: int, sequence: int, levels: bytes) -> bytes:
    """ArtDmx field by field, each level checked, as packers in plain Python write it."""
    packet = b"Art-Net\0" + struct.pack("<H", 0x5000) + struct.pack(">H", 14)
    packet += (
        struct.pack("BB", sequence, 0) + struct.pack("<H", port_address) + struct.pack(">H", len(levels))
    )
    for level in levels:
        packet += struct.pack("B", min(max(int(level), 0), 255))
    return packet


def test_art_net_in_plain_python(measured: Callable[..., Any]) -> None:
    benchmark = measured("plain Python, level by level", ART_NET_GROUP, reference=True)
    theirs = benchmark(pack_as_textbooks_do, 7, 1, universe(1))
    assert theirs == bytes(ArtDmx(7, 512).pack(universe(1)))


def test_art_net(measured: Callable[..., Any]) -> None:
    packets, data = ArtDmx(7, 512), universe(1)
    assert len(measured("ours", ART_NET_GROUP)(packets.pack, data)) == 530


@pytest.fixture
def nodes() -> Iterator[tuple[ArtNetReceiver, ArtNetReceiver]]:
    with ArtNetReceiver() as one, ArtNetReceiver() as other:
        yield one, other


def test_two_universes_sent(
    measured: Callable[..., Any], nodes: tuple[ArtNetReceiver, ArtNetReceiver]
) -> None:
    wires = [config("artnet", universe=number, port=node.port) for number, node in enumerate(nodes)]
    universes = open_universes(wires)
    levels = bytearray(universe(1))
    clock = iter(range(1 << 40))

    def send() -> None:
        now = float(next(clock))  # a second apart: each of them leaves
        levels[0] ^= 1
        for one in universes:
            one.offer(levels, now)

    measured("Art-Net over loopback", SENT_GROUP)(send)
    assert all(one.wire.dropped == 0 and one.wire.sent > 0 for one in universes)
    assert all(node.poll(1.0) for node in nodes)
