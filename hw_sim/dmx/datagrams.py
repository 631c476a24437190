"""A UDP socket that decodes datagrams as they come, each with its arrival."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable
from types import TracebackType
from typing import Generic, Self, TypeVar

from hw_sim.receive_buffer import widen

Packet = TypeVar("Packet")

RECEIVE_BUFFER_BYTES = 4 << 20  # minutes of universes: a slow reader loses none
LONGEST = 65536


class DatagramReceiver(Generic[Packet]):
    """`malformed` counts what could not be decoded, `complaint` says why of the last one."""

    def __init__(
        self, decode: Callable[[bytes], Packet], malformed: type[ValueError], host: str, port: int
    ) -> None:
        self._decode = decode
        self._malformed = malformed
        self.malformed = 0
        self.complaint = ""
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        widen(self.socket, RECEIVE_BUFFER_BYTES)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self.socket.bind((host, port))
        except OSError:
            self.socket.close()
            raise
        self.socket.setblocking(False)
        self.port: int = self.socket.getsockname()[1]

    def poll(self, timeout_s: float = 0.0) -> list[tuple[float, Packet]]:
        """The datagrams received; waits for the first one, timeout_s at most."""
        select.select([self.socket], [], [], timeout_s)
        packets: list[tuple[float, Packet]] = []
        while True:
            try:
                datagram = self.socket.recv(LONGEST)
            except BlockingIOError:
                return packets
            arrival = time.monotonic()
            try:
                packets.append((arrival, self._decode(datagram)))
            except self._malformed as error:
                self.malformed += 1
                self.complaint = str(error)

    def close(self) -> None:
        """Free the port."""
        self.socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
