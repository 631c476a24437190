"""What the stage of a pair tells the lights and the projector of its box."""

from __future__ import annotations

import time
from pathlib import Path

from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import MASTER
from appliance.lights.run import Speaking
from appliance.outputs.dmx.art_net import cancel_merge
from appliance.outputs.dmx.open_wire import open_universes
from appliance.pair.part import STALE_S, BoxPart, DarkWhileFollowing, PartReader, PartWriter, forget_part
from appliance.show.box import BoxConfig
from appliance.show.pair import PairConfig
from hw_sim.dmx.sacn import Data
from hw_sim.dmx.sacn_node import SacnNode, SacnReceiver
from hw_sim.peers import free_ports
from tests.outputs.dmx.conftest import config, universe

NOW = 100.0


def part(leads: bool, peer_lives: bool = True, epoch: int = 1, written: float = NOW) -> BoxPart:
    return BoxPart(leads, leads, True, peer_lives, epoch, written)


def test_lights_of_a_stage_that_died_are_silent_only_where_the_other_box_took_over() -> None:
    assert part(True).may_speak(NOW + STALE_S / 2)
    assert not part(True).may_speak(NOW + 2 * STALE_S)
    assert part(True, peer_lives=False).may_speak(NOW + 60.0)
    assert not part(False).may_speak(NOW)
    assert not part(True)._replace(speaks=False).may_speak(NOW)  # its cable is out


def test_a_stage_without_a_pair_leaves_no_part_behind(tmp_path: Path) -> None:
    writer = PartWriter(tmp_path)
    writer.write(part(False))
    reader = PartReader(tmp_path)
    assert reader.read() == part(False)
    writer.close()
    forget_part(tmp_path)
    assert PartReader(tmp_path).read() is None


def test_the_followers_picture_is_black_and_comes_with_the_lead(tmp_path: Path) -> None:
    states, writer = ShowStateWriter(tmp_path), PartWriter(tmp_path)
    states.write(ShowState().to(MASTER, 0.5))
    reader, now = DarkWhileFollowing(tmp_path), time.monotonic()
    writer.write(part(False, written=now))
    assert reader.read().level(now) == 0.0
    writer.write(part(True, written=now))
    assert reader.read().level(now) == 0.5


def test_lights_that_take_over_count_for_more_at_once_and_end_their_stream_when_they_cede(
    tmp_path: Path,
) -> None:
    (tmp_path / "pair.key").write_text("00" * 16)
    pair = PairConfig(role="second", peer=["127.0.0.2"], secret=tmp_path / "pair.key")
    port = free_ports(1)[0]
    first, second = (open_universes([config("sacn", universe=300, port=port)])[0] for _ in range(2))
    writer, node = PartWriter(tmp_path), SacnNode()
    speaking = Speaking(BoxConfig(pair=pair, runtime=tmp_path), [second])
    with SacnReceiver((300,), port=port) as receiver:

        def shown(now: float) -> bytes | None:
            for _, packet in receiver.poll(0.3):
                if isinstance(packet, Data):
                    node.receive(packet, now)
            return node.levels(300, now)

        first.offer(universe(1), NOW)
        writer.write(part(False))
        assert not speaking.may_speak(NOW) and shown(NOW) == universe(1)
        writer.write(part(True, epoch=2, written=NOW + 0.05))
        assert speaking.may_speak(NOW + 0.05)
        second.offer(universe(2), NOW + 0.05)
        assert shown(NOW + 0.05) == universe(2), "the source that is silent still counts"
        writer.write(part(False, written=NOW + 0.1))
        assert not speaking.may_speak(NOW + 0.1)
        assert shown(NOW + 0.1) == universe(1)
    for one in (first, second):
        one.close(NOW)
    speaking.close()


def test_art_nets_merge_is_ended_by_an_address_packet_that_changes_nothing_else() -> None:
    packet = cancel_merge()
    assert len(packet) == 107 and packet[:8] == b"Art-Net\0" and packet[8:10] == b"\x00\x60"
    assert packet[10:12] == b"\x00\x0e" and packet[12] == 0x7F  # version 14; net: as it is
    assert not any(packet[14:96]) and packet[96:105] == bytes([0x7F]) * 9  # names and switches: as they are
    assert packet[106] == 0x01  # AcCancelMerge
