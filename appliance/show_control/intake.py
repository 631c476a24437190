"""Intake: the datagrams that wait at the control port, in the order in which they are carried out."""

from __future__ import annotations

import re
from collections import deque

from appliance.show_control.packet import BUNDLE
from appliance.show_control.port import Address, Port

URGENT = ("/panic", "/blackout", "/stop", "/go")
WAITING, URGENT_WAITING = 256, 4096  # datagrams; then the oldest gives way
_LOOKED_AT = 1024  # datagrams at most before one has its turn: 5 ms
_ADDRESS = re.compile(b"(?:%s)\0" % "|".join(URGENT).encode())

Datagram = tuple[bytes, Address]


class Intake:
    """Empties the port's socket at each step, so that the kernel drops nothing urgent.

    First comes /panic, then what else is urgent, then the rest; /panic overtakes no /go, which would lift it.

    dropped: how many datagrams gave way.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._urgent: deque[Datagram] = deque()
        self._rest: deque[Datagram] = deque()
        self.dropped = 0

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits outside the socket."""
        return not (self._urgent or self._rest)

    def take(self) -> Datagram | None:
        """What is carried out next; None: nothing waits. Never blocks, never raises."""
        for _ in range(_LOOKED_AT):
            if (found := self._port.take()) is None:
                break
            received = found[0]
            if received.startswith(b"/panic\0") and not any(
                b"/go\0" in waiting for waiting, _ in self._urgent
            ):
                return found
            if _is_urgent(received):
                self._put_off(self._urgent, found, URGENT_WAITING)
            elif received:
                self._put_off(self._rest, found, WAITING)
        waiting = self._urgent or self._rest
        return waiting.popleft() if waiting else None

    def _put_off(self, waiting: deque[Datagram], found: Datagram, most: int) -> None:
        if len(waiting) == most:
            waiting.popleft()
            self.dropped += 1
        waiting.append(found)


def _is_urgent(received: bytes) -> bool:
    """Whether it, or a message of its bundle, is: a bundle stays together, and keeps its order."""
    find = _ADDRESS.search if received.startswith(BUNDLE) else _ADDRESS.match
    return find(received) is not None
