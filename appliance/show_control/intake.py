"""Intake: the datagrams that wait at the control port, in the order in which they are carried out."""

from __future__ import annotations

import re
from collections import deque

from appliance.show_control.packet import BUNDLE, URGENT, urgent_address
from appliance.show_control.port import Address, Port

WAITING, URGENT_WAITING, LIVE_WAITING = 256, 4096, 1024  # datagrams; then the oldest gives way
WAITING_BYTES = 4 << 20  # for each kind
_LOOKED_AT = 1024  # datagrams at most before one has its turn: 5 ms
_IN_BUNDLE = re.compile(b"(?:%s)\0" % "|".join(URGENT).encode())
_LIVE = re.compile(  # 12: a time tag, the first one's size; MXTP and head: Xsens MVN and mocopi
    b"(?:#bundle\0.{12})*/(?:VMC|mocap/0)/|MXTP|[^/].{3}head", re.DOTALL
)

Datagram = tuple[bytes, Address]


class Intake:
    """Empties the port's socket at each step, so that the kernel drops nothing urgent.

    First comes /panic, then what else is urgent, then the rest; /panic overtakes no /go, which would lift it.
    A live dancer's stream is no command: it waits by itself.

    dropped: how many commands gave way; live_dropped: how many datagrams of a live dancer.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._urgent = _Waiting(URGENT_WAITING)
        self._rest = _Waiting(WAITING)
        self._live = _Waiting(LIVE_WAITING)
        self._at_port = self._live_at_port = self._came = self._came_live = 0

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits outside the socket."""
        return not (self._urgent.datagrams or self._rest.datagrams or self._live.datagrams)

    @property
    def dropped(self) -> int:
        """How many commands gave way, here or in the kernel."""
        return self._urgent.dropped + self._rest.dropped + self._at_port

    @property
    def live_dropped(self) -> int:
        """How many datagrams of a live dancer did."""
        return self._live.dropped + self._live_at_port

    def take(self) -> Datagram | None:
        """The next command to carry out; None: no command waits. Never blocks, never raises."""
        for _ in range(_LOOKED_AT):
            if (found := self._port.take()) is None:
                break
            received = found[0]
            urgent = urgent_address(received)
            if urgent == b"/panic" and not any(b"/go" in waiting for waiting, _ in self._urgent.datagrams):
                return found
            if urgent or (received.startswith(BUNDLE) and _IN_BUNDLE.search(received)):
                self._urgent.put(found)
            elif _LIVE.match(received):
                self._came_live += 1
                self._live.put(found)
            elif received:
                self._rest.put(found)
            self._came += 1
        return self._urgent.take() or self._rest.take()

    def take_live(self) -> Datagram | None:
        """The oldest datagram of a live dancer that has come; None: none waits."""
        return self._live.take()

    def note_kernel(self) -> None:
        """Count what the kernel has dropped since the last call, as most of what came meanwhile was."""
        lost = self._port.dropped() - self._at_port - self._live_at_port
        if 2 * self._came_live > self._came:
            self._live_at_port += lost
        else:
            self._at_port += lost
        self._came = self._came_live = 0


class _Waiting:
    """Datagrams of one kind, the oldest first; the oldest gives way to what is one too many or too large."""

    def __init__(self, most: int) -> None:
        self.datagrams: deque[Datagram] = deque()
        self.dropped = 0
        self._most, self._bytes = most, 0

    def put(self, found: Datagram) -> None:
        self.datagrams.append(found)
        self._bytes += len(found[0])
        while len(self.datagrams) > self._most or self._bytes > WAITING_BYTES:
            self.take()
            self.dropped += 1

    def take(self) -> Datagram | None:
        if not self.datagrams:
            return None
        found = self.datagrams.popleft()
        self._bytes -= len(found[0])
        return found
