"""The control port: takes datagrams from permitted senders; drops and counts all others."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
import struct
from collections.abc import Sequence

from appliance.sensor.transports.udp import bind_early
from appliance.show_control.packet import Message, datagram

LARGEST_DATAGRAM = 65_507  # the largest of UDP: programs of motion capture send a whole figure at once
_SAY_EVERY_S = 60.0
_WAITING_BYTES = 4 << 20  # or as much as net.core.rmem_max allows: what comes while this process does not run
_SO_MEMINFO, _DROPS = 55, 8  # Linux, asm-generic/socket.h and linux/sock_diag.h: nine numbers, the last one

Address = tuple[str, int]


def open_port(host: str, port: int) -> socket.socket:
    """The control port's socket, bound, also to an address that comes later. Raises OSError: it is taken."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _WAITING_BYTES)
    try:
        bind_early(one, (host, port))
    except OSError:
        one.close()
        raise
    return one


class Port:
    """Takes over a bound socket. `senders`: addresses and networks that may command, beside this machine.

    strangers: datagrams from any other sender; newest_stranger: the address of the last one.
    """

    def __init__(self, bound: socket.socket, senders: Sequence[str] = ()) -> None:
        self._socket = bound
        self._socket.setblocking(False)
        host, self.number = self._socket.getsockname()
        own = ["127.0.0.0/8"] if host == "0.0.0.0" else ["127.0.0.0/8", host]
        self._networks = [ipaddress.IPv4Network(one, strict=False) for one in (*own, *senders)]
        self._known: dict[str, bool] = {}
        self.strangers = 0
        self.newest_stranger = ""
        self._said = 0
        self._said_at = float("-inf")

    def fileno(self) -> int:
        """To poll for datagrams."""
        return self._socket.fileno()

    def take(self) -> tuple[bytes, Address] | None:
        """The oldest datagram, empty if it is dropped; None: none waits. Never blocks, never raises."""
        try:
            received, sender = self._socket.recvfrom(LARGEST_DATAGRAM)
        except BlockingIOError:
            return None
        except OSError:  # the kernel reports that an earlier reply found no listener
            return b"", ("", 0)
        if not self._may_command(sender[0]):
            self.strangers += 1
            self.newest_stranger = sender[0]
            return b"", sender
        return received, sender

    def dropped(self) -> int:
        """How many datagrams the kernel dropped because the socket was full."""
        memory = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * (_DROPS + 1))
        return int(struct.unpack_from("=I", memory, 4 * _DROPS)[0])

    def send(self, to: Address, message: Message) -> None:
        """Send a message; it is dropped when the network does not take it at once."""
        with contextlib.suppress(OSError, ValueError):  # ValueError: a text that OSC cannot carry
            self._socket.sendto(datagram(message), to)

    def news(self, now: float) -> str:
        """A sentence about strangers, at most once a minute; else empty."""
        if self.strangers == self._said or now < self._said_at + _SAY_EVERY_S:
            return ""
        self._said, self._said_at = self.strangers, now
        return (
            f"{self.newest_stranger} sends commands and is not listed ({self.strangers} dropped so far). "
            "Nothing is changed. To let them: `senders` under control in the box file."
        )

    def close(self) -> None:
        self._socket.close()

    def _may_command(self, host: str) -> bool:
        may = self._known.get(host)
        if may is None:
            address = ipaddress.IPv4Address(host)
            may = any(address in network for network in self._networks)
            if len(self._known) > 1000:  # a flood from made-up addresses
                self._known.clear()
            self._known[host] = may
        return may
