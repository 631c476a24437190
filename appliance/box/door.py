"""The door of an HTTP server: lets connections in, and closes strangers' before a known one has no room."""

from __future__ import annotations

import asyncio
import socket
import ssl
import time
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from appliance.box.served import plain_address

MOST = 256  # connections at once
MOST_STRANGERS = 160  # strangers' connections; the rest is for known devices
MOST_FROM_ONE = 96  # strangers' connections from one address
IDLE_S = 30.0  # after its last request a stranger's connection is closed, unless it watches
_LOOK_S = 1.0
_RETRY_S = 0.1  # after the system refused a connection
_HANDSHAKE_S = 10.0
_QUIET_S = 10.0  # without a stranger who gave way: the crowd is over

Peer = tuple[Any, ...]  # address and port, as the socket tells them
Guest = TypeVar("Guest")


class _Connection:
    """One connection. newest: when its last request came, monotonic seconds; watches: it is a WebSocket."""

    def __init__(self, address: str, now: float) -> None:
        self.address, self.newest = address, now
        self.is_known = self.watches = False
        self.transport: asyncio.BaseTransport | None = None
        self.opening: asyncio.Task[None] | None = None

    @property
    def is_over(self) -> bool:
        if self.transport is not None:
            return self.transport.is_closing()
        return self.opening is not None and self.opening.done()

    def close(self) -> None:
        if isinstance(self.transport, asyncio.WriteTransport):
            self.transport.abort()
        elif self.opening is not None:
            self.opening.cancel()


class Door:
    """Accepts on a listening socket. Each connection is a stranger's until a request of it says otherwise.

    A new connection is always let in, as long as a stranger's can be closed for it: the one that has been
    quiet for the longest time, of the address that has most of them. report: hears the address of the crowd
    when one had to give way, and "" when the crowd is over.
    """

    def __init__(
        self, report: Callable[[str], None], monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._report, self._monotonic, self._crowd = report, monotonic, ""
        self._connections: dict[Peer, _Connection] = {}
        self._crowded_until = 0.0

    def __len__(self) -> int:
        return len(self._connections)

    async def accept(
        self,
        listening: socket.socket,
        serve: Callable[[], asyncio.BaseProtocol],
        context: ssl.SSLContext | None = None,
    ) -> None:
        """Accept for ever; one connection in each turn of the loop, so that requests have their turn too."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                accepted, peer = await loop.sock_accept(listening)
            except OSError:  # no descriptor or no memory: a stranger gives one back
                self._give_way(self._strangers(), self._monotonic())
                await asyncio.sleep(_RETRY_S)
                continue
            accepted.setblocking(False)
            connection = self.let_in(peer, self._monotonic())
            connection.opening = loop.create_task(_open(connection, accepted, serve, context))
            await asyncio.sleep(0)

    async def watch(self) -> None:
        """Close what is idle, all the time."""
        while True:
            await asyncio.sleep(_LOOK_S)
            self.look(self._monotonic())

    def let_in(self, peer: Peer, now: float) -> _Connection:
        """Note a new connection, and close what has to give way for it."""
        address = plain_address(str(peer[0]))
        self._forget_closed()
        strangers = self._strangers()
        own = [one for one in strangers if one.address == address]
        if len(own) >= MOST_FROM_ONE:
            self._give_way(own, now)
        elif len(strangers) >= MOST_STRANGERS or len(self._connections) >= MOST:
            self._give_way(strangers or list(self._connections.values()), now)
        made = self._connections[peer] = _Connection(address, now)
        return made

    def note_request(self, peer: object, is_known: bool, watches: bool) -> None:
        """A request came by this connection; is_known: from a device that is no stranger."""
        connection = self._connections.get(peer) if isinstance(peer, tuple) else None
        if connection is not None:
            connection.newest = self._monotonic()
            connection.is_known, connection.watches = is_known, watches

    def look(self, now: float) -> None:
        """Close strangers' idle connections; the crowd is over when nobody had to give way for a while."""
        self._forget_closed()
        for one in self._connections.values():
            if not (one.is_known or one.watches) and now - one.newest > IDLE_S:
                one.close()
        if now > self._crowded_until:
            self._report_crowd("")

    def _strangers(self) -> list[_Connection]:
        return [one for one in self._connections.values() if not one.is_known]

    def _give_way(self, candidates: list[_Connection], now: float) -> None:
        """Closes one of them, and reports its address."""
        if not candidates:
            return
        leaving = gives_way((one, one.address, one.newest) for one in candidates)
        leaving.close()
        self._connections = {peer: one for peer, one in self._connections.items() if one is not leaving}
        self._crowded_until = now + _QUIET_S
        self._report_crowd(leaving.address)

    def _report_crowd(self, crowd: str) -> None:
        if crowd != self._crowd:
            self._crowd = crowd
            self._report(crowd)

    def _forget_closed(self) -> None:
        self._connections = {peer: one for peer, one in self._connections.items() if not one.is_over}


def gives_way(guests: Iterable[tuple[Guest, str, float]]) -> Guest:
    """From (guest, address, time) of each: the one to close, the oldest of the address with the most."""
    listed = list(guests)
    crowd = Counter(address for _, address, _ in listed)
    return min(listed, key=lambda one: (-crowd[one[1]], one[2]))[0]


async def _open(
    connection: _Connection,
    accepted: socket.socket,
    serve: Callable[[], asyncio.BaseProtocol],
    context: ssl.SSLContext | None,
) -> None:
    """Hand a connection over to its protocol; a handshake that breaks is the other side's trouble."""
    patience_s = None if context is None else _HANDSHAKE_S
    try:
        connection.transport, _ = await asyncio.get_running_loop().connect_accepted_socket(
            serve, accepted, ssl=context, ssl_handshake_timeout=patience_s
        )
    except OSError:
        accepted.close()
    except asyncio.CancelledError:
        accepted.close()
        raise
