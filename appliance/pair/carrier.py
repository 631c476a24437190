"""Whether this box reaches its receivers: the network cards that lead to them, and their cables."""

from __future__ import annotations

import ipaddress
import os
import socket
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from appliance.pair.roles import FRESH_S, Role
from appliance.show.box import OutputsConfig

_ROUTES, _CARDS = Path("/proc/net/route"), Path("/sys/class/net")
_SETTLE_S = 0.08  # a box hears the other one within that time
_LIVED_S = 1.0  # a box that was heard so shortly before the cable was out may lead by now
_FORWARDS_S = 32.0  # IEEE 802.1D: a switch may pass nothing on for two times 15 s after a cable came in
_ON_THE_WAY_S = 0.004  # a datagram from an unknown link, so soon after the cable was out, came by the cable
_FIND_EACH_S = 0.25
_Network = tuple[int, int]  # its address and its mask, as the kernel has them


class Carrier:
    """The cables of the cards that lead to the receivers.

    is_out: at the newest look none of these cards had something alive at its end. is_up: one had, or the
    receivers need none. Neither: no card is known that leads to them.
    """

    def __init__(
        self,
        receivers: Iterable[str],
        routes: Path = _ROUTES,
        cards: Path = _CARDS,
        peers: Sequence[str] = (),
    ) -> None:
        """receivers: their addresses, or this machine's in their network. peers: the other box's."""
        self._receivers = [one for one in receivers if not ipaddress.IPv4Address(one).is_loopback]
        self._routes, self._folder, self._peers = routes, cards, peers
        self._beside: list[str] = []  # addresses of the other box that other cards lead to
        self._cards: dict[Path, _Network] = {}
        self.is_out, self.is_up = False, not self._receivers
        self._find_at = self._changed_at = self._out_at = float("-inf")

    def look(self, now: float) -> None:
        """Once a tick: some 10 microseconds."""
        if not self._receivers:
            return
        if now >= self._find_at:
            self._find_at = now + _FIND_EACH_S
            self._find()
        was_out, self.is_up = self.is_out, any(map(_is_up, self._cards))
        self.is_out = bool(self._cards) and not self.is_up
        if was_out is not self.is_out:
            self._changed_at = now
            if self.is_out:
                self._out_at = now

    def _find(self) -> None:
        """Find the cards once; of an adapter that was unplugged the one that leads to the same network now.

        While it is away the kernel would send to the receivers by any card that leads elsewhere.
        """
        lost = [card for card in self._cards if not card.parent.exists()]
        if self._cards and not lost:
            return
        networks = _networks_to(self._receivers, self._routes)
        found = {self._folder / name / "carrier": network for name, network in networks.items()}
        if lost:
            gone = {self._cards[card] for card in lost}
            found = {card: network for card, network in found.items() if network in gone}
            if not found:
                return
            found |= {card: network for card, network in self._cards.items() if card not in lost}
        self._cards = found
        self._beside = [one for one in self._peers if self.is_apart([one])]

    def is_apart(self, peers: Sequence[str]) -> bool:
        """Whether datagrams to these addresses leave by other cards than those to the receivers."""
        outputs = cards_to(self._receivers, self._routes)
        return bool(outputs) and not {*outputs} & {*cards_to(peers, self._routes)}

    def may_speak(self, now: float, heard: float) -> bool:
        """A leader whose cable came back is silent until it has heard the other box: that may lead by now.

        heard: when that was last heard. It takes up to a second where the network has forgotten an address
        (the kernel asks for it once a second) while multicast passes at once, and longer behind a switch.
        """
        if self.is_out or heard > self._changed_at:
            return not self.is_out
        lived = heard > self._out_at - _LIVED_S
        return now - self._changed_at >= (_FORWARDS_S if lived else _SETTLE_S)

    def is_heard_nonetheless(self, now: float, came_after: float, heard_from: Mapping[str, float]) -> bool:
        """Whether another link still joins the two boxes while the receivers' cable is out.

        came_after: the other box's newest datagram came later than that, whenever it was read. heard_from:
        when each of its addresses was last heard.
        """
        if not self.is_out:
            return False
        return came_after > self._changed_at + _ON_THE_WAY_S or any(
            now - heard_from.get(one, float("-inf")) < FRESH_S for one in self._beside
        )

    def reaches(self, role: Role, now: float, heard: float) -> bool:
        """Whether a box in this role reaches the receivers, as Roles.look asks for it. heard: as above."""
        if role is Role.FOLLOWS:
            return self.knows_silence(now, heard)
        return not self.is_out if role is Role.LEADS else self.is_up

    def knows_silence(self, now: float, heard: float) -> bool:
        """Whether a follower that hears nothing knows by it that the leader is gone."""
        return not self.is_out and (heard > self._changed_at or now - self._changed_at >= _FORWARDS_S)


def receivers_of(outputs: OutputsConfig) -> Iterator[str]:
    """Addresses that lead to the receivers."""
    yield from (one.host for one in outputs.osc)
    yield from (one.interface for one in outputs.posistagenet)
    yield from (address for one in outputs.dmx if (address := one.interface or one.host))


def cards_to(addresses: Iterable[str], routes: Path = _ROUTES) -> list[str]:
    """Names of the network cards by which datagrams to these addresses leave, each once."""
    return [*_networks_to(addresses, routes)]


def _networks_to(addresses: Iterable[str], routes: Path) -> dict[str, _Network]:
    """The cards by their names, each with the network in which it finds such an address."""
    try:
        rows = [line.split() for line in routes.read_text().splitlines()[1:]]
    except OSError:
        return {}
    found: dict[str, _Network] = {}
    for address in addresses:
        (number,) = struct.unpack("=I", socket.inet_aton(address))
        ways = [(row[0], (int(row[1], 16), int(row[7], 16))) for row in rows]
        ways = [(name, network) for name, network in ways if number & network[1] == network[0]]
        if ways:
            name, network = max(ways, key=lambda way: way[1][1].bit_count())
            found[name] = network
    return found


def _is_up(card: Path) -> bool:
    try:
        descriptor = os.open(card, os.O_RDONLY)
        try:
            return os.read(descriptor, 1) == b"1"
        finally:
            os.close(descriptor)
    except OSError:  # it is switched off
        return False
