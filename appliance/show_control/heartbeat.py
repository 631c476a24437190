"""The heartbeat: once a second `/bunraku/status` to every listener in the box file."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence

from appliance.show_control.packet import datagram
from appliance.show_control.settings import Listener
from appliance.show_control.status_messages import STATUS, Status

EVERY_S = 1.0


class Heartbeat:
    """Beats on a grid of its own, whatever the stage does; a listener that is away delays no other."""

    def __init__(self, listeners: Sequence[Listener], now: float) -> None:
        self._listeners = tuple(listeners)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setblocking(False)
        self.due = now if listeners else float("inf")  # monotonic seconds

    def beat(self, status: Status, now: float) -> None:
        """Send it; after a stall the grid starts over, and nothing is sent twice."""
        self.due = self.due + EVERY_S if self.due + EVERY_S > now else now + EVERY_S
        message = datagram((STATUS, *status))
        for listener in self._listeners:
            with contextlib.suppress(OSError):
                self._socket.sendto(message, listener)

    def close(self) -> None:
        """Send no more."""
        self._socket.close()
