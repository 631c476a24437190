"""Whether the network card that leads to the other box has a cable with something alive at its end."""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from pathlib import Path

_ROUTES, _CARDS = Path("/proc/net/route"), Path("/sys/class/net")
_SETTLE_S = 0.08  # a box hears the other one within that time


class Carrier:
    """Holds a leader silent for a moment after its cable came back: another box may lead by now."""

    def __init__(self, peers: Sequence[str], routes: Path = _ROUTES, cards: Path = _CARDS) -> None:
        self._cards = tuple(
            {name: cards / name / "carrier" for peer in peers for name in cards_to(peer, routes)}.values()
        )
        self._silent_until = float("-inf")

    def holds_silent(self, now: float) -> bool:
        """Call it before each frame while the other box is not heard: some 20 microseconds."""
        if self._cards and not any(_is_up(card) for card in self._cards):
            self._silent_until = now + _SETTLE_S
        return now < self._silent_until


def cards_to(peer: str, routes: Path = _ROUTES) -> list[str]:
    """Names of the network cards whose networks the address is in, without loopback."""
    (address,) = struct.unpack("=I", socket.inet_aton(peer))
    found = []
    try:
        lines = routes.read_text().splitlines()[1:]
    except OSError:
        return []
    for line in lines:
        name, network, _, _, _, _, _, mask, *_ = line.split()
        if int(mask, 16) and name != "lo" and address & int(mask, 16) == int(network, 16):
            found.append(name)
    return found


def _is_up(card: Path) -> bool:
    try:
        return card.read_text().strip() == "1"
    except OSError:  # it is switched off
        return False
