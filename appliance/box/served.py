"""Shared by the box's HTTP servers: their socket, the names of this machine, a client's address."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Iterable


def listening(host: str, port: int) -> socket.socket:
    """`::` accepts IPv4 too; a machine without IPv6 listens only on IPv4. Raises OSError."""
    if host == "::" and not socket.has_dualstack_ipv6():
        host = "0.0.0.0"
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, dualstack_ipv6=host == "::")


class OwnNames:
    """The names by which browsers reach this machine; more: those that the box file lists."""

    def __init__(self, more: Iterable[str]) -> None:
        own = socket.gethostname().lower()
        self._names = {"localhost", own, f"{own}.local", *(name.lower() for name in more)}

    def has(self, host: str) -> bool:
        """Whether a Host header names this machine. Addresses do: a foreign page that points its name at the
        box (DNS rebinding) still sends its name.
        """
        name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
        if name.lower() in self._names:
            return True
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True


def plain_address(address: str) -> str:
    """An address without its zone; an IPv4 address also where it came in by IPv6."""
    return address.split("%")[0].lower().removeprefix("::ffff:")
