"""Shared by Art-Net and sACN: one universe in one datagram."""

from __future__ import annotations

from appliance.outputs.datagram_sender import DatagramPath, DatagramSender


class NetworkWire(DatagramSender):
    """A universe that leaves by datagrams."""

    def __init__(self, name: str, path: DatagramPath, cure: str) -> None:
        super().__init__(name, path)
        self._cure = cure

    def take_over(self, raised: int, now: float) -> None:
        """Another box was the source until now; receivers take this one, which counts for more by so much."""

    def cede(self, now: float) -> None:
        """Another box is the source from now on; receivers need not wait for this one."""

    @property
    def trouble(self) -> str | None:
        """Says what happened, what the audience sees, what to do."""
        if self.is_open or not self.last_error:
            return None
        return f"{self.name}: {self.last_error}. Its lights do not follow; the show goes on. {self._cure}"

    @property
    def remark(self) -> str:
        """That it leaves from another port than its protocol asks for; "" where all is as it should be."""
        wanted, own = self._path.source_port, self._socket
        if wanted is None or own is None:
            return ""
        host, port = own.getsockname()
        if port == wanted or host == self._path.host:
            return ""
        return (
            f"{self.name}: another program on this machine has the UDP port {wanted}, so it leaves from "
            f"{port}. Most nodes take that; for one that stays dark, end the other program."
        )
