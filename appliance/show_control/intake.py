"""Intake: what has come in at the control port, in the order in which it is carried out: urgent first."""

from __future__ import annotations

import re
from collections import deque

from appliance.show_control.packet import BUNDLE
from appliance.show_control.port import Address, Port

URGENT = ("/panic", "/blackout", "/stop", "/go")
WAITING = 256  # datagrams that are not urgent; then the oldest gives way
_LOOKED_AT = 1024  # datagrams at most before one that is not urgent has its turn: 5 ms
_ADDRESS = re.compile(b"(?:%s)\0" % "|".join(URGENT).encode())

Datagram = tuple[bytes, Address]


class Intake:
    """Empties the port's socket at each step: nothing urgent waits in it behind others, or is dropped there.

    dropped: how many datagrams gave way.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._waiting: deque[Datagram] = deque()
        self.dropped = 0

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits but what the socket holds."""
        return not self._waiting

    def take(self) -> Datagram | None:
        """The oldest urgent datagram, else the oldest; None: none waits. Never blocks, never raises."""
        for _ in range(_LOOKED_AT):
            if (found := self._port.take()) is None:
                break
            if _is_urgent(found[0]):
                return found
            if found[0]:
                self._put_off(found)
        return self._waiting.popleft() if self._waiting else None

    def _put_off(self, found: Datagram) -> None:
        if len(self._waiting) == WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(found)


def _is_urgent(received: bytes) -> bool:
    """Whether it, or a message of its bundle, is: a bundle stays together, and keeps its order."""
    find = _ADDRESS.search if received.startswith(BUNDLE) else _ADDRESS.match
    return find(received) is not None
