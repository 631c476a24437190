"""An sACN node: joins universes and shows the levels of the most important source that is alive."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from itertools import zip_longest
from uuid import UUID

from hw_sim.dmx import sacn
from hw_sim.dmx.datagrams import DatagramReceiver

LOST_AFTER_S = 2.5  # E1.31 appendix A, E131_NETWORK_DATA_LOSS_TIMEOUT
SEQUENCE_REACH = 20  # section 6.7.2


@dataclass
class Source:
    """One source of one universe, as it was heard last."""

    heard: float
    packet: sacn.Data


class SacnReceiver(DatagramReceiver[sacn.Data | sacn.Discovery]):
    """Listens to universes by multicast on one interface (its own address), and to unicast on its port."""

    def __init__(
        self, universes: tuple[int, ...], interface: str = "127.0.0.1", port: int = sacn.PORT
    ) -> None:
        super().__init__(sacn.decode, sacn.MalformedSacnError, "", port)
        self.socket.setsockopt(socket.IPPROTO_IP, 49, 0)  # IP_MULTICAST_ALL: only what was joined here
        for universe in universes:
            group = f"239.255.{universe // 256}.{universe % 256}"  # section 9.3.1
            membership = socket.inet_aton(group) + socket.inet_aton(interface)
            self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)


class SacnNode:
    """Levels that a fixture behind the node would show: highest priority, highest level among equals."""

    def __init__(self) -> None:
        self._sources: dict[tuple[int, UUID], Source] = {}
        self.out_of_order = 0

    def receive(self, packet: sacn.Data, now: float) -> None:
        """One packet; `now` in monotonic seconds."""
        key = (packet.universe, packet.cid)
        if packet.terminated:
            self._sources.pop(key, None)
            return
        known = self._sources.get(key)
        if known is not None and now - known.heard <= LOST_AFTER_S:
            step = (packet.sequence - known.packet.sequence + 128) % 256 - 128
            if -SEQUENCE_REACH < step <= 0:
                self.out_of_order += 1
                return
        if not packet.preview and packet.start_code == 0:
            self._sources[key] = Source(now, packet)

    def levels(self, universe: int, now: float) -> bytes | None:
        """None while no source is alive; a lamp then holds what it shows."""
        alive = [
            source.packet
            for (number, _), source in self._sources.items()
            if number == universe and now - source.heard <= LOST_AFTER_S
        ]
        if not alive:
            return None
        highest = max(packet.priority for packet in alive)
        ranked = [packet.levels for packet in alive if packet.priority == highest]
        return bytes(map(max, zip_longest(*ranked, fillvalue=0)))
