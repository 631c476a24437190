"""sACN: one universe by multicast or to one address; what a box says about itself as a source."""

from __future__ import annotations

from uuid import UUID

from appliance.outputs.datagram_sender import DatagramPath, DatagramSender
from appliance.outputs.dmx import sacn_packet
from appliance.outputs.dmx.network_wire import NetworkWire
from appliance.show.dmx import DmxConfig

DISCOVERY_EACH_S = 10.0  # E1.31 appendix A, E131_UNIVERSE_DISCOVERY_INTERVAL
TERMINATIONS = 3  # section 6.2.6
LOOPBACK = "127.0.0.1"


class SacnSource:
    """This box in one network, and which universes it sends: consoles and monitors list it."""

    def __init__(self, cid: UUID, name: str, path: DatagramPath) -> None:
        self.cid = cid
        self.name = name
        self._universes: list[int] = []
        self._next = float("-inf")
        self._sender = DatagramSender(path)

    def begins(self, universe: int) -> None:
        """From now on it is among those that are announced."""
        self._universes.append(universe)

    def ends(self, universe: int) -> None:
        """It is announced no more."""
        self._universes.remove(universe)
        if not self._universes:
            self._sender.close()

    def announce(self, now: float) -> None:
        """The list of universes, each 10 s; free in between."""
        if now >= self._next:
            self._next = now + DISCOVERY_EACH_S
            self._sender.send(sacn_packet.discovery(self.cid, self.name, self._universes), now)


class SacnWire(NetworkWire):
    """One universe of a source. Keep-alives come from the pace."""

    def __init__(self, config: DmxConfig, source: SacnSource) -> None:
        number = config.number_on_wire
        interface = config.interface or (None if config.host else LOOPBACK)
        host = config.host or sacn_packet.group(number)
        inside = "inside this machine" if interface == LOOPBACK else f"multicast from {interface}"
        super().__init__(
            f"sACN {config.host or inside}, universe {number}",
            DatagramPath(host, config.udp_port, interface, hops=config.ttl),
            "Check the network cable, and host and interface in the box file.",
        )
        self._number = number
        self._source = source
        self._packets = sacn_packet.DataPackets(
            source.cid,
            config.source_name,
            number,
            config.channels,
            priority=config.priority,
            preview=config.preview,
        )
        source.begins(number)

    def send(self, data: bytes | bytearray, now: float) -> None:
        """One universe, 512 levels."""
        self._sender.send(self._packets.pack(data), now)
        self._source.announce(now)

    def close(self, now: float) -> None:
        """Tell receivers that this source leaves: they need not wait 2.5 s for the next one in rank."""
        for _ in range(TERMINATIONS):
            self._sender.send(self._packets.terminate(), now)
        self._sender.close()
        self._source.ends(self._number)
