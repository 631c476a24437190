"""sACN packets, read by a receiver that knows the standard alone, and by the sacn library."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from uuid import UUID, uuid4

import pytest
import sacn as library

from appliance.outputs.dmx import sacn_packet
from appliance.outputs.dmx.open_wire import open_universes
from appliance.outputs.dmx.pace import Universe
from appliance.outputs.dmx.sacn import DISCOVERY_EACH_S, FILE, component_identifier
from hw_sim.dmx.sacn import Data, Discovery, MalformedSacnError, decode
from hw_sim.dmx.sacn_node import SacnNode, SacnReceiver
from hw_sim.peers import free_ports
from tests.outputs.dmx.conftest import config, universe
from tests.system import namespace
from tests.system.namespace import Cable, Namespace

CID = UUID("00112233-4455-6677-8899-aabbccddeeff")


def packets(**keys: object) -> sacn_packet.DataPackets:
    return sacn_packet.DataPackets(CID, "A box", 7, 512, **keys)  # type: ignore[arg-type]


def one_universe(**keys: object) -> Universe:
    return open_universes([config("sacn", **keys)])[0]


def received(receiver: SacnReceiver) -> list[Data]:
    return [packet for _, packet in receiver.poll(1.0) if isinstance(packet, Data)]


def test_every_field_of_a_data_packet() -> None:
    packet = decode(bytes(packets(priority=150, preview=True).pack(universe())))
    assert packet == Data(
        cid=CID,
        source_name="A box",
        priority=150,
        synchronisation=0,
        sequence=0,
        preview=True,
        terminated=False,
        universe=7,
        start_code=0,
        levels=universe(),
    )


def test_the_sacn_library_packs_the_same() -> None:
    theirs = library.messages.data_packet.DataPacket(
        tuple(CID.bytes), "A box", 7, tuple(universe()), priority=150, sequence=1
    )
    ours = packets(priority=150)
    ours.pack(universe(3))
    assert bytes(ours.pack(universe())) == bytes(theirs.getBytes())


def test_fewer_channels_make_a_shorter_packet() -> None:
    short = sacn_packet.DataPackets(CID, "A box", 1, 24)
    assert decode(bytes(short.pack(universe()))).levels == universe()[:24]  # type: ignore[union-attr]


def test_the_sequence_goes_from_255_to_0() -> None:
    ours = packets()
    numbers = [decode(bytes(ours.pack(universe()))).sequence for _ in range(300)]  # type: ignore[union-attr]
    assert numbers == [place % 256 for place in range(300)]


@pytest.mark.parametrize("name", ["Bühne", "ü" * 63, "x" * 63])
def test_a_name_of_any_letters_ends_with_a_zero(name: str) -> None:
    packet = decode(bytes(sacn_packet.DataPackets(CID, name, 1, 512).pack(universe())))
    assert packet.source_name
    assert name.startswith(packet.source_name)


@pytest.mark.parametrize(
    ("number", "group"), [(1, "239.255.0.1"), (256, "239.255.1.0"), (63999, "239.255.249.255")]
)
def test_multicast_groups(number: int, group: str) -> None:
    assert sacn_packet.group(number) == group


def test_multicast_inside_this_machine_by_default() -> None:
    port = free_ports(1)[0]
    with SacnReceiver((300,), port=port) as receiver:
        one = one_universe(universe=300, port=port)
        one.offer(universe(), 0.0)
        assert [packet.levels for packet in received(receiver)] == [universe()]
        one.close(0.1)


def test_unicast() -> None:
    port = free_ports(1)[0]
    with SacnReceiver((), port=port) as receiver:
        one = one_universe(host="127.0.0.1", port=port)
        one.offer(universe(), 0.0)
        assert [packet.universe for packet in received(receiver)] == [1]
        one.close(0.1)


def test_goodbye_is_said_three_times() -> None:
    port = free_ports(1)[0]
    with SacnReceiver((1,), port=port) as receiver:
        one = one_universe(port=port)
        one.offer(universe(), 0.0)
        one.offer(bytes(512), 0.001)
        one.close(0.002)
        heard = received(receiver)
    assert [packet.terminated for packet in heard] == [False, False, True, True, True]
    assert [packet.sequence for packet in heard] == [0, 1, 2, 3, 4]
    assert heard[1].levels == bytes(512)


def test_a_source_lists_its_universes_each_ten_seconds() -> None:
    port = free_ports(1)[0]
    with SacnReceiver((64214,), port=port) as receiver:
        wires = [config("sacn", universe=number, port=port, source_name="Box") for number in (9, 2, 700)]
        universes = open_universes(wires)
        for now in range(25):
            for one in universes:
                one.offer(bytes(512), float(now))
        found = [packet for _, packet in receiver.poll(1.0)]
        for one in universes:
            one.close(25.0)
    assert [type(packet) for packet in found] == [Discovery] * 3
    assert {packet.universes for packet in found if isinstance(packet, Discovery)} == {(2, 9, 700)}
    assert {(p.source_name, p.page, p.last_page) for p in found if isinstance(p, Discovery)} == {
        ("Box", 0, 0)
    }
    assert len({packet.cid for packet in found}) == 1


def test_the_list_of_universes_goes_where_the_receiver_is() -> None:
    if namespace.why_not() is not None:
        pytest.skip(f"This needs a network of its own: {namespace.why_not()}")
    with Namespace("box") as box, Namespace("desk") as desk:
        Cable(box, "10.77.3.1/24", desk, "10.77.3.2/24")
        with desk.entered():
            receiver = SacnReceiver((64214,), interface="10.77.3.2")
        with receiver, box.entered():
            wires = [
                config("sacn", universe=1, host="10.77.3.2"),
                config("sacn", universe=2, host="127.0.0.1"),
            ]
            universes = open_universes(wires)
            found: set[tuple[int, ...]] = set()
            for attempt in range(10):  # a cable that was just plugged in may lose the first
                for one in universes:
                    one.offer(bytes(512), attempt * DISCOVERY_EACH_S)
                found |= {
                    packet.universes for _, packet in receiver.poll(1.0) if isinstance(packet, Discovery)
                }
                if found:
                    break
            for one in universes:
                one.close(1.0)
    assert found == {(1,)}


def test_a_box_keeps_its_identity(tmp_path: Path) -> None:
    state = tmp_path / "state"
    first = component_identifier(state)
    assert component_identifier(state) == first
    assert UUID((state / FILE).read_text().strip()) == first
    assert component_identifier(tmp_path / "another") != first


def test_a_broken_identity_is_made_anew(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("half a")
    made = component_identifier(tmp_path)
    assert component_identifier(tmp_path) == made


def test_an_identity_that_cannot_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert component_identifier(tmp_path / "file").version == 4
    assert component_identifier(None) != component_identifier(None)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda packet: packet[:100], "too few"),
        (lambda packet: b"\x00\x11" + packet[2:], "preamble"),
        (lambda packet: packet[:4] + b"ASC-E1.18" + packet[13:], "no ACN"),
        (lambda packet: packet + b"\0", "ends at"),
        (lambda packet: packet[:16] + b"\x62" + packet[17:], "flags"),
        (lambda packet: packet[:21] + b"\x05" + packet[22:], "root vector"),
        (lambda packet: packet[:43] + b"\x01" + packet[44:], "framing vector"),
        (lambda packet: packet[:44] + b"x" * 64 + packet[108:], "ended by a zero"),
        (lambda packet: packet[:44] + b"\xff\0" + packet[46:], "UTF-8"),
        (lambda packet: packet[:108] + b"\xc9" + packet[109:], "more than 200"),
        (lambda packet: packet[:113] + b"\xfa\x00" + packet[115:], "63999"),
        (lambda packet: packet[:117] + b"\x03" + packet[118:], "DMP"),
        (lambda packet: packet[:123] + b"\x02\x02" + packet[125:], "properties"),
    ],
)
def test_the_receiver_sees_what_is_wrong(change: object, complaint: str) -> None:
    assert callable(change)
    with pytest.raises(MalformedSacnError, match=complaint):
        decode(change(bytes(packets().pack(universe()))))


class Box:
    """A source as a node hears it."""

    def __init__(self, priority: int, level: int) -> None:
        self.levels = bytes([level]) * 512
        self._packets = sacn_packet.DataPackets(uuid4(), "A box", 1, 512, priority=priority)

    def says(self) -> Data:
        packet = decode(bytes(self._packets.pack(self.levels)))
        assert isinstance(packet, Data)
        return packet

    def leaves(self) -> Data:
        packet = decode(bytes(self._packets.terminate()))
        assert isinstance(packet, Data)
        return packet


def test_a_node_follows_the_more_important_box_and_falls_back() -> None:
    node, first, second = SacnNode(), Box(100, 10), Box(150, 20)
    node.receive(first.says(), 0.0)
    node.receive(second.says(), 0.0)
    assert node.levels(1, 0.1) == second.levels
    node.receive(first.says(), 2.0)
    assert node.levels(1, 2.5) == second.levels
    assert node.levels(1, 2.6) == first.levels  # the second one is silent for more than 2.5 s
    node.receive(second.says(), 3.0)
    node.receive(second.leaves(), 3.1)
    assert node.levels(1, 3.1) == first.levels
    assert node.levels(1, 5.0) is None


def test_a_node_shows_the_higher_level_of_two_boxes_that_send_unequally_many() -> None:
    node, whole, short = SacnNode(), Box(100, 10), Box(100, 20)
    node.receive(whole.says(), 0.0)
    node.receive(replace(short.says(), levels=bytes([20]) * 30), 0.0)
    assert node.levels(1, 0.1) == bytes([20]) * 30 + bytes([10]) * (len(whole.levels) - 30)


def test_a_node_ignores_what_was_overtaken() -> None:
    node, box = SacnNode(), Box(100, 10)
    early, late = box.says(), box.says()
    node.receive(late, 0.0)
    node.receive(early, 0.1)
    assert node.out_of_order == 1


def test_a_keep_alive_leaves_before_a_second_is_over() -> None:
    port = free_ports(1)[0]
    with SacnReceiver((1,), port=port) as receiver:
        one = one_universe(port=port)
        began = time.monotonic()
        left = [tick * 0.025 for tick in range(400) if one.offer(universe(), began + tick * 0.025)]
        assert len(received(receiver)) == len(left)
        one.close(began + 10.0)
    gaps = [late - early for early, late in pairwise(left[4:])]
    assert gaps
    assert all(0.8 <= gap <= 1.0 for gap in gaps)
