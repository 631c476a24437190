"""Art-Net packets, read by a receiver that knows the standard alone."""

from __future__ import annotations

import socket

import pytest

from appliance.outputs.dmx.art_net import PORT, ArtDmx, ArtNetWire
from hw_sim.dmx.artnet import ArtNetReceiver, MalformedArtNetError, decode
from hw_sim.peers import free_ports
from tests.outputs.dmx.conftest import config, universe
from tests.system.namespace import Cable, Namespace, why_not

WHY_NOT = why_not()


def test_a_universe_arrives_as_it_was_sent() -> None:
    with ArtNetReceiver() as node:
        wire = ArtNetWire(config("artnet", universe=0x2A57, port=node.port))
        for tick in range(3):
            wire.send_universe(universe(tick), 10.0 + tick)
        packets = [packet for _, packet in node.poll(1.0)]
        wire.close()
    assert [packet.levels for packet in packets] == [universe(tick) for tick in range(3)]
    assert [packet.sequence for packet in packets] == [1, 2, 3]
    assert {(packet.net, packet.subnet, packet.universe) for packet in packets} == {(0x2A, 0x5, 0x7)}
    assert (wire.sent, wire.dropped, wire.trouble, node.malformed) == (3, 0, None, 0)


@pytest.mark.parametrize("port_address", [0, 1, 15, 16, 255, 256, 32767])
def test_every_port_address(port_address: int) -> None:
    packet = decode(bytes(ArtDmx(port_address, 512).pack(universe())))
    assert packet.port_address == port_address


@pytest.mark.parametrize(("channels", "length"), [(512, 512), (24, 24), (25, 26), (511, 512)])
def test_the_length_is_even(channels: int, length: int) -> None:
    levels = decode(bytes(ArtDmx(1, channels).pack(universe()))).levels
    assert levels == universe()[:channels] + bytes(length - channels)


def test_the_sequence_goes_from_255_to_1() -> None:
    packets = ArtDmx(1, 512)
    numbers = [decode(bytes(packets.pack(universe()))).sequence for _ in range(600)]
    assert numbers == [place % 255 + 1 for place in range(600)]


def test_another_number_on_the_wire() -> None:
    with ArtNetReceiver() as node:
        wire = ArtNetWire(config("artnet", universe=1, number=0, port=node.port))
        wire.send_universe(universe(), 0.0)
        assert node.poll(1.0)[0][1].port_address == 0
        wire.close()


def test_a_broadcast_needs_the_box_file_s_word() -> None:
    shy = ArtNetWire(config("artnet", host="127.255.255.255", port=free_ports(1)[0]))
    shy.send_universe(universe(), 0.0)
    assert shy.dropped == 1
    assert shy.trouble is not None
    assert "allows no broadcast" in shy.trouble
    shy.close()


def test_a_broadcast_reaches_who_listens_to_all() -> None:
    with ArtNetReceiver(host="") as node:
        wire = ArtNetWire(config("artnet", host="127.255.255.255", broadcast=True, port=node.port))
        wire.send_universe(universe(), 0.0)
        assert node.poll(1.0)[0][1].levels == universe()
        wire.close()


def test_a_node_that_goes_and_comes_back() -> None:
    port = free_ports(1)[0]
    wire = ArtNetWire(config("artnet", port=port))
    now = 0.0
    while wire.dropped < 3:  # nobody listens: Linux says so with the next one
        wire.send_universe(universe(), now)
        now += 0.025
    assert not wire.is_open
    assert wire.trouble == (
        "Art-Net 127.0.0.1, universe 1: no program listens on that port. "
        "Its lights do not follow; the show goes on. "
        "Check the node's power, its network cable, and its address in the box file."
    )
    with ArtNetReceiver(port=port) as node:
        back = now + 1.0  # the longest pause
        while now <= back + 0.025:
            wire.send_universe(universe(9), now)
            now += 0.025
        assert node.poll(1.0)[-1][1].levels == universe(9)
    assert wire.is_open
    assert wire.trouble is None
    wire.close()


@pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))
@pytest.mark.parametrize("is_broadcast", [False, True])
def test_it_leaves_from_the_port_of_art_net_and_several_universes_share_it(is_broadcast: bool) -> None:
    """Some nodes take nothing from another port."""
    with Namespace("box") as box, Namespace("node") as node:
        Cable(box, "10.77.0.1/24", node, "10.77.0.2/24")
        with node.entered():
            receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with receiver:
            receiver.bind(("", PORT))
            receiver.settimeout(10.0)
            host = {"host": "10.77.0.255", "broadcast": True} if is_broadcast else {"host": "10.77.0.2"}
            with box.entered():
                wires = [ArtNetWire(config("artnet", universe=number, **host)) for number in (1, 2)]
                for wire in wires:
                    wire.send_universe(universe(), 0.0)
            senders = {
                decode(packet).port_address: sender for packet, sender in map(receiver.recvfrom, (600,) * 2)
            }
            assert senders == dict.fromkeys((1, 2), ("10.77.0.1", PORT))
            assert [wire.remark for wire in wires] == ["", ""]
        for wire in wires:
            wire.close()


@pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))
def test_where_another_program_has_the_port_it_leaves_from_another_and_says_so() -> None:
    with Namespace("box") as box, Namespace("node") as node:
        Cable(box, "10.77.0.1/24", node, "10.77.0.2/24")
        with node.entered():
            receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with box.entered():
            other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with receiver, other:
            receiver.bind(("", PORT))
            receiver.settimeout(10.0)
            other.bind(("", PORT))
            wire = ArtNetWire(config("artnet", host="10.77.0.2"))
            assert wire.remark == ""
            with box.entered():
                wire.send_universe(universe(), 0.0)
            packet, (_, port) = receiver.recvfrom(600)
            assert decode(packet).levels == universe() and port != PORT
            assert "another program on this machine has the UDP port 6454" in wire.remark
            assert wire.trouble is None
            wire.close()


def test_on_this_machine_it_leaves_the_port_to_the_program_that_listens() -> None:
    with ArtNetReceiver() as node:
        wire = ArtNetWire(config("artnet", port=node.port))
        wire.send_universe(universe(), 0.0)
        assert node.poll(1.0)[0][1].levels == universe()
        assert wire._socket is not None and wire._socket.getsockname()[1] != PORT
        assert wire.remark == ""
        wire.close()


def test_an_interface_that_this_machine_does_not_have() -> None:
    wire = ArtNetWire(config("artnet", interface="192.0.2.77"))
    wire.send_universe(universe(), 0.0)
    assert wire.dropped == 1
    assert "does not have the interface's address" in wire.last_error
    wire.close()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda packet: packet[:17], "too few"),
        (lambda packet: b"art-net\0" + packet[8:], "does not begin"),
        (lambda packet: packet[:8] + b"\x50\x00" + packet[10:], "not ArtDmx"),
        (lambda packet: packet[:11] + b"\x0d" + packet[12:], "too old"),
        (lambda packet: packet[:15] + b"\x80" + packet[16:], "7 bits"),
        (lambda packet: packet[:16] + b"\x01\xff" + packet[18:], "odd"),
        (lambda packet: packet[:-2], "levels follow"),
    ],
)
def test_the_receiver_sees_what_is_wrong(change: object, complaint: str) -> None:
    packet = bytes(ArtDmx(1, 512).pack(universe()))
    assert callable(change)
    with pytest.raises(MalformedArtNetError, match=complaint):
        decode(change(packet))
