"""What Art-Net and sACN share: one universe in one datagram."""

from __future__ import annotations

from appliance.outputs.datagram_sender import DatagramPath, DatagramSender


class NetworkWire:
    """Counts and words of a universe that leaves by datagrams."""

    def __init__(self, name: str, path: DatagramPath, cure: str) -> None:
        self.name = name
        self._sender = DatagramSender(path)
        self._cure = cure

    @property
    def sent(self) -> int:
        """Universes that left."""
        return self._sender.sent

    @property
    def dropped(self) -> int:
        """Universes that did not."""
        return self._sender.dropped

    @property
    def last_error(self) -> str:
        """Why the last one was dropped."""
        return self._sender.last_error

    @property
    def is_open(self) -> bool:
        """Whether the newest universe left."""
        return self._sender.is_open

    @property
    def trouble(self) -> str | None:
        """What happened, what the audience sees, what to do."""
        if self.is_open or not self.last_error:
            return None
        return f"{self.name}: {self.last_error}. Its lights do not follow; the show goes on. {self._cure}"
