"""Readings from the network: one UDP socket, drained without waiting, each datagram with its true arrival."""

from __future__ import annotations

import socket
import struct
import sys
import time
from collections import Counter

from appliance.sensor import wire

# Linux, include/uapi/asm-generic/socket.h: the kernel stamps each datagram as it comes in, on the wall clock.
SO_TIMESTAMPNS = 35
TIMESPEC = struct.Struct("@qq")
OLDEST_S = 1.0
# The kernel counts about 768 bytes for a datagram of ours and doubles what is asked for: room for some 250.
# More would hold stale readings back in a flood, less would lose the burst after a stall of the network.
RECEIVE_BUFFER_BYTES = 96 * 1024


class PortError(OSError):
    """The port for the sensors cannot be opened; the message is for the person who set up the box."""


class UdpIntake:
    """Listens on `host`:`port` (0: any free port, see `address`). Raises PortError when it cannot."""

    def __init__(self, host: str, port: int) -> None:
        self.counts: Counter[str] = Counter()
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except (OSError, OverflowError, UnicodeError) as error:
            raise PortError(_advice(host, port, error)) from error
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise PortError(_advice(host, port, error)) from error
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        if sys.platform == "linux":
            self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.address: tuple[str, int] = self._socket.getsockname()[:2]
        self._buffer = bytearray(2 * wire.LARGEST)  # longer datagrams are cut, and then have the wrong length
        self._view = memoryview(self._buffer)
        self._buffers = [self._buffer]
        self._ancillary_bytes = socket.CMSG_SPACE(TIMESPEC.size)
        self._monotonic_minus_wall: float | None = None

    def receive(self, now: float) -> tuple[wire.Buffer, float] | None:
        """The next waiting datagram and its arrival (monotonic seconds, <= now); None when none waits.

        The bytes are valid until the next call. Never waits, never raises: the network's errors are counted.
        """
        try:
            length, ancillary, _, _ = self._socket.recvmsg_into(self._buffers, self._ancillary_bytes)
        except BlockingIOError:
            self._monotonic_minus_wall = None
            return None
        except OSError:
            self.counts["socket_error"] += 1
            return None
        return self._view[:length], self._arrival(ancillary, now)

    def close(self) -> None:
        self._view.release()
        self._socket.close()

    def _arrival(self, ancillary: list[tuple[int, int, bytes]], now: float) -> float:
        """The kernel's stamp on the box's clock. A wall clock that was set meanwhile, or no stamp: `now`."""
        if not ancillary or len(ancillary[0][2]) != TIMESPEC.size:
            return now
        if self._monotonic_minus_wall is None:  # compared anew in each drain: the wall clock may be set
            self._monotonic_minus_wall = time.monotonic() - time.time()
        seconds, nanoseconds = TIMESPEC.unpack(ancillary[0][2])
        arrival: float = seconds + nanoseconds * 1e-9 + self._monotonic_minus_wall
        return arrival if now - OLDEST_S < arrival < now else now


def _advice(host: str, port: int, error: Exception) -> str:
    return (
        f"UDP port {port} on {host} cannot be opened ({error}). No sensor can reach the box by network. "
        "Is a second bunraku running? Stop it, or give another port or host under sensors: udp: in box.yaml."
    )
