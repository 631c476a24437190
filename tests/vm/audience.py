"""Somebody outside of the machine who receives the dance."""

from __future__ import annotations

import socket
import time
from dataclasses import dataclass, field

from hw_sim.osc_receiver import decode

HOST_SEEN_FROM_INSIDE = "10.0.2.2"
"""This machine, as qemu's own network shows it to the one inside."""


@dataclass
class Audience:
    """Ticks of the frames that came, in order."""

    ticks: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]

    def close(self) -> None:
        self._socket.close()

    def forget(self) -> None:
        """What came until now, read or not."""
        self._socket.setblocking(False)
        while True:
            try:
                self._socket.recv(65536)
            except BlockingIOError:
                break
        self.ticks.clear()

    def await_frames(self, count: int, within_s: float) -> list[int]:
        """The ticks of the next `count` frames."""
        known, deadline = len(self.ticks), time.monotonic() + within_s
        while len(self.ticks) < known + count:
            left_s = deadline - time.monotonic()
            assert left_s > 0, f"{len(self.ticks) - known} of {count} frames came within {within_s:.0f} s"
            self._socket.settimeout(left_s)
            try:
                datagram = self._socket.recv(65536)
            except TimeoutError:
                continue
            self.ticks += [
                arguments[0] for address, arguments in decode(datagram) if address == "/bunraku/frame"
            ]
        return self.ticks[known:]
