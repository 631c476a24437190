"""Listeners of the box file: receivers that hear what the box says, whether they ask or not."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence

from appliance.show_control.packet import Message, datagram
from appliance.show_control.settings import Listener


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
        """Send no more."""
        for one in self._listeners.values():
            one.close()
