"""sACN: one universe by multicast or unicast; the source's list of universes."""

from __future__ import annotations

import contextlib
from math import inf
from pathlib import Path
from uuid import UUID, uuid4

from appliance.box.durable import write_whole
from appliance.outputs.datagram_sender import DatagramPath, DatagramSender
from appliance.outputs.dmx import sacn_packet
from appliance.outputs.dmx.network_wire import NetworkWire
from appliance.pose.foreign_file import content
from appliance.show.dmx import DmxConfig

FILE = "sacn-cid"
_LARGEST = 100

DISCOVERY_EACH_S = 10.0  # E1.31 appendix A, E131_UNIVERSE_DISCOVERY_INTERVAL
TERMINATIONS = 3  # section 6.2.6
LOOPBACK = "127.0.0.1"


class SacnSource(DatagramSender):
    """This box on one network and the universes that it sends, as consoles and monitors list them."""

    def __init__(self, cid: UUID, name: str, path: DatagramPath) -> None:
        super().__init__(name, path)
        self.cid = cid
        self.universes: list[int] = []
        self._announce_at = -inf

    def announce_universes(self, now: float) -> None:
        """Send the list of universes, every 10 s; free in between."""
        if now >= self._announce_at:
            self._announce_at = now + DISCOVERY_EACH_S
            self.send_datagrams((sacn_packet.discovery(self.cid, self.name, self.universes),), now)


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
        self._number, self._priority = number, config.priority
        self._source = source
        self._packets = sacn_packet.DataPackets(
            source.cid,
            config.source_name,
            number,
            config.channels,
            priority=config.priority,
            preview=config.preview,
        )
        source.universes.append(number)

    def send_universe(self, levels: bytes | bytearray, now: float) -> None:
        self.send_datagrams((self._packets.pack(levels),), now)
        self._source.announce_universes(now)

    def take_over(self, raised: int, now: float) -> None:
        """Another box was the source until now: this one counts for more by so much."""
        self._packets.rank(self._priority + raised)

    def cede(self, now: float) -> None:
        """Another box is the source from now on: receivers need not wait 2.5 s for it."""
        for _ in range(TERMINATIONS):
            self.send_datagrams((self._packets.terminate(),), now)

    def close(self) -> None:
        """Terminate the stream."""
        self.cede(inf)  # no pause after a failure: now or never
        super().close()
        self._source.universes.remove(self._number)
        if not self._source.universes:
            self._source.close()


def component_identifier(state: Path | None) -> UUID:
    """Read the component identifier from the state folder, or make one and save it (E1.31 section 5.6).

    Without a folder, or where it cannot be written, a new one each time: receivers then see a new source.
    """
    fresh = uuid4()
    if state is None:
        return fresh
    saved = _read(state / FILE)
    if saved is not None:
        return saved
    with contextlib.suppress(OSError):
        state.mkdir(parents=True, exist_ok=True)
        write_whole(state / FILE, f"{fresh}\n".encode())
    return fresh


def _read(file: Path) -> UUID | None:
    try:
        return UUID(content(file, _LARGEST).decode("ascii").strip())
    except (OSError, ValueError):
        return None
