"""Listeners of the box file: receivers that hear what the box says, whether they ask or not."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence

from appliance.levers.status import Status
from appliance.show_control.packet import Message, datagram
from appliance.show_control.settings import Listener

EVERY_S = 1.0


class Listeners:
    """A socket for each: datagrams for a machine that is switched off wait, and hold up no other's."""

    def __init__(self, listeners: Sequence[Listener]) -> None:
        self._listeners = {one: socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for one in listeners}
        for one in self._listeners.values():
            one.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            one.setblocking(False)

    def send(self, *messages: Message, but: Listener | None = None) -> None:
        """Send messages, in one datagram, to all of them but one; it is dropped where the network is busy."""
        with contextlib.suppress(ValueError):  # a text that OSC cannot carry
            packed = datagram(*messages)
            for listener, sender in self._listeners.items():
                if listener != but:
                    with contextlib.suppress(OSError):
                        sender.sendto(packed, listener)

    def close(self) -> None:
        for one in self._listeners.values():
            one.close()


class Heartbeat:
    """Beats on its own grid, whatever the stage does; a listener that is away delays no other."""

    def __init__(self, listeners: Sequence[Listener], now: float) -> None:
        self._listeners = Listeners(listeners)
        self.due = now if listeners else float("inf")  # monotonic seconds

    def beat(self, status: Status, now: float) -> None:
        """Send it; after a stall the grid starts over, and nothing is sent twice."""
        self.due = self.due + EVERY_S if self.due + EVERY_S > now else now + EVERY_S
        self._listeners.send(*status.messages())

    def close(self) -> None:
        self._listeners.close()
