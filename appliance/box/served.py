"""Shared by the box's HTTP servers: their socket, this machine's names and addresses, a client's address."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import ipaddress
import re
import socket
import struct
from collections.abc import Iterable
from pathlib import Path

_ELSEWHERE = "192.0.2.1", 9  # an address of no machine (RFC 5737): which of ours would a packet leave by?
_GET_ADDRESS, _GET_NETMASK = 0x8915, 0x891B  # SIOCGIFADDR, SIOCGIFNETMASK, netdevice(7)
_IPV6 = Path("/proc/net/if_inet6")
_AVAHI, _ANSWERS_WITHIN_S = Path("/run/avahi-daemon/socket"), 0.5  # nss-mdns asks there, too
_LINK_LOCAL = "20"  # scope, in hexadecimal, as the kernel writes it


def listening(host: str, port: int) -> socket.socket:
    """`::` accepts IPv4 too; a machine without IPv6 listens only on IPv4. Raises OSError."""
    if host == "::" and not socket.has_dualstack_ipv6():
        host = "0.0.0.0"
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, dualstack_ipv6=host == "::")


def from_here(host: str) -> str:
    """The address by which this machine reaches a socket that listens on this host."""
    return "127.0.0.1" if host in ("0.0.0.0", "::") else host


def port_cure(error: OSError, section: str) -> str:
    """The cure for a port that cannot be opened. section: of the box file."""
    cures = {
        errno.EADDRINUSE: "Is a second bunraku running? Stop it, or give another port",
        errno.EADDRNOTAVAIL: "This machine does not have this address now. Give one that it has as host",
        errno.EACCES: "Ports below 1024 are only for root. Give another port",
    }
    return f"{cures.get(error.errno or 0, 'Give another port')} under {section}: in the box file."


def outward_host() -> str:
    """The address by which other machines reach this one; its name where it has none."""
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.connect(_ELSEWHERE)
        return str(asking.getsockname()[0])
    return next((address for _, address in addresses()), socket.gethostname())


def addresses() -> list[tuple[str, str]]:
    """Interface and address by which the box can be reached from elsewhere: IPv4, then IPv6."""
    return [(name, one.partition("/")[0]) for name, one in _interfaces() if "%" not in one]


def own_networks() -> list[str]:
    """The networks that this machine's interfaces are in, as a box file has them."""
    found = (ipaddress.ip_interface(one.replace("%", "")) for _, one in _interfaces())
    return [str(one.network) for one in found]


def _interfaces() -> list[tuple[str, str]]:
    """Interface and address/network; a link-local address of IPv6 has a % before the slash."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for _, name in socket.if_nameindex():
            asked = struct.pack("256s", name.encode())
            try:
                address, mask = (fcntl.ioctl(asking, what, asked) for what in (_GET_ADDRESS, _GET_NETMASK))
            except OSError:
                continue  # it has none
            found.append((name, "/".join(socket.inet_ntoa(one[20:24]) for one in (address, mask))))
    lines = _IPV6.read_text().splitlines() if _IPV6.exists() else []
    for number, _, length, scope, _, name in map(str.split, lines):
        local = "%" * (scope == _LINK_LOCAL)
        found.append((name, f"{ipaddress.IPv6Address(int(number, 16))}{local}/{int(length, 16)}"))
    loopback = [one for one in found if ipaddress.ip_interface(one[1].replace("%", "")).ip.is_loopback]
    return [one for one in found if one not in loopback]


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches this host."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def name_in_network() -> str:
    """The name by which others find this machine (mDNS), as avahi has it: another box may have had the same
    before; empty without avahi, or without a network.
    """
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.settimeout(_ANSWERS_WITHIN_S)
        asking.connect(str(_AVAHI))
        asking.sendall(f"RESOLVE-ADDRESS {outward_host()}\n".encode())
        said = asking.recv(1024).decode(errors="replace").split()
        return said[3] if len(said) == 4 and said[0] == "+" else ""  # +, interface, protocol, name
    return ""


class OwnNames:
    """The names by which browsers reach this machine; more: those that the box file lists."""

    def __init__(self, more: Iterable[str]) -> None:
        own = socket.gethostname().lower()
        self._names = {"localhost", own, *(name.lower() for name in more)}
        self._in_network = re.compile(rf"{re.escape(own)}(-\d+)?\.local")  # numbered where two have a name

    def has(self, host: str) -> bool:
        """Whether a Host header names this machine. Addresses do: a foreign page that points its name at the
        box (DNS rebinding) still sends its name.
        """
        name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
        if name.lower() in self._names or self._in_network.fullmatch(name.lower()):
            return True
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True


def plain_address(address: str) -> str:
    """An address without its zone; an IPv4 address also where it came in by IPv6."""
    return address.split("%")[0].lower().removeprefix("::ffff:")
