"""Datagrams to one address: what the network does not take is dropped, a failed socket is opened again."""

from __future__ import annotations

import errno
import ipaddress
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 1.0
WELL_AFTER_S = 2.0  # longer than the pause between two keep-alives: a refusal comes back with the next one
PASSING = (errno.EAGAIN, errno.ENOBUFS)  # a full buffer: the next datagram may go through
_MEANINGS = {
    errno.ECONNREFUSED: "no program listens on that port",
    errno.ENETUNREACH: "no network leads there",
    errno.EHOSTUNREACH: "that machine does not answer",
    errno.EADDRNOTAVAIL: "this machine does not have the interface's address",
    errno.ENODEV: "this machine does not have the interface's address",
    errno.EACCES: "the network allows no broadcast to that address",
    errno.EPERM: "this machine's firewall refuses it",
    errno.EAGAIN: "the network does not take more",
    errno.EMSGSIZE: "the message is too long for a datagram",
}


def meaning_of(error: OSError) -> str:
    """Why a datagram did not leave, as a clause."""
    return _MEANINGS.get(error.errno or 0, str(error.strerror))


@dataclass(frozen=True)
class DatagramPath:
    """Where datagrams go, and out of which network interface (its own address; None: the kernel's choice).

    source_port: where they come from, unless another program has it or they stay on this machine; senders of
    one user share it.
    """

    host: str
    port: int
    interface: str | None = None
    broadcast: bool = False
    hops: int = 1  # time to live of multicast, IP_MULTICAST_TTL
    source_port: int | None = None

    def open(self) -> socket.socket:
        """A connected socket: only on those does Linux report refused datagrams. Raises OSError."""
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            opened.setblocking(False)
            if self.broadcast:
                opened.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            if ipaddress.IPv4Address(self.host).is_multicast:
                opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, self.hops)
                if self.interface:
                    own = socket.inet_aton(self.interface)
                    opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, own)
            if not (self.source_port and self._is_bound(opened, self.source_port)) and self.interface:
                opened.bind((self.interface, 0))
            opened.connect((self.host, self.port))
        except OSError:
            opened.close()
            raise
        return opened

    def _is_bound(self, opened: socket.socket, port: int) -> bool:
        """Bind it to the source port; False where that is taken, or would receive what it sends."""
        own = replace(self, source_port=None).own_address()
        if own == self.host or ipaddress.IPv4Address(self.host).is_loopback:
            return False
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        try:
            opened.bind((own, port))
        except OSError as error:
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise
            return False
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 0)  # nobody reads what nodes answer there
        return True

    def own_address(self) -> str:
        """This machine's address on that path; sends nothing. Raises OSError."""
        with self.open() as opened:
            return str(opened.getsockname()[0])


class DatagramSender:
    """One receiver, with a socket that is opened again after a failure.

    Datagrams for a machine that is switched off wait 3 s for its address and fill a socket's buffer: with one
    socket for all, two such machines cost the others 85 % of their frames.
    """

    def __init__(self, name: str, path: DatagramPath, is_asked_for: bool = True) -> None:
        self.name = name  # in messages: where datagrams go, and what they carry
        self.is_asked_for = is_asked_for  # a box file names it, so that its absence is worth a word
        self.sent = 0  # datagrams handed to the network
        self.dropped = 0  # datagrams that were not
        self.last_error = ""  # why the last one was dropped; stays when all is well again
        self.is_open = False  # whether the newest datagram left
        self.speaks_until = float("inf")  # monotonic seconds; a box that follows another one sends nothing
        self.is_gone = False  # whether some of the last second did not; the stage's watch sets it
        self._path = path
        self._socket: socket.socket | None = None
        self._pause_s = FIRST_PAUSE_S
        self._retry_at = float("-inf")
        self._well_since = float("inf")

    def send_datagrams(self, datagrams: Sequence[memoryview | bytes | bytearray], now: float) -> None:
        """Send them in order; after a failure the rest is dropped too. Never waits, never raises.

        `now`: monotonic seconds.
        """
        if time.monotonic() >= self.speaks_until:  # also one that was stopped after it was allowed to
            return
        left = 0
        if now >= self._retry_at:
            try:
                if self._socket is None:
                    self._socket = self._path.open()
                    self._well_since = now
                for datagram in datagrams:
                    self._socket.send(datagram)
                    left += 1
                self.is_open = True
                if now - self._well_since >= WELL_AFTER_S:
                    self._pause_s = FIRST_PAUSE_S
            except OSError as error:
                self._note_failure(error, now)
        self.sent += left
        self.dropped += len(datagrams) - left

    @property
    def source(self) -> tuple[str, int] | None:
        """Address and port that its datagrams come from; None: it is not open."""
        if self._socket is None:
            return None
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self.is_open = False

    def _note_failure(self, error: OSError, now: float) -> None:
        self.last_error = meaning_of(error)
        if error.errno in PASSING:
            return
        DatagramSender.close(self)
        self._retry_at = now + self._pause_s
        self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)
