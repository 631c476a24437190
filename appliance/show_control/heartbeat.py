"""The heartbeat: once a second the status, in one bundle, to every listener in the box file."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.levers.status import Status
from appliance.show_control.listeners import Listeners
from appliance.show_control.settings import Listener

EVERY_S = 1.0


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
        """Send no more."""
        self._listeners.close()
