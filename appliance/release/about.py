"""This box, described for people: which show dances and which would instead, its release, its addresses."""

from __future__ import annotations

import fcntl
import ipaddress
import socket
import struct
from importlib.metadata import version
from pathlib import Path
from typing import Any

from appliance.release.choice import Choice

HOME = Path("/opt/bunraku")
_GET_ADDRESS = 0x8915  # SIOCGIFADDR, netdevice(7)
_IPV6 = Path("/proc/net/if_inet6")
_LINK_LOCAL = "20"  # scope, in hexadecimal, as the kernel writes it


def about(chosen: Path | None, box: Path | None, home: Path = HOME) -> dict[str, Any]:
    """For JSON. chosen: what the preflight chose; box: the box file; home: where releases are installed.

    shows: id, source and `good` (has danced on this box) of what dances and then of what would dance instead,
    in this order; refused, aside: sentences on what was found and is not danced; releases: those
    installed, oldest first; release: the folder's name of the one that dances, None where none is installed.
    """
    choice = None if chosen is None else Choice.read(chosen)
    if choice is not None:
        box = choice.first.box
    return {
        "shows": [{"id": one.id, "source": one.source, "good": one.good} for one in choice.pairs]
        if choice
        else [],
        "refused": list(choice.refused) if choice else [],
        "aside": [one.words for one in choice.aside] if choice else [],
        "box_file": None if box is None else str(box),
        "version": version("bunraku"),
        "release": current.resolve().name if (current := home / "current").is_dir() else None,
        "releases": releases(home),
        "host": socket.gethostname(),
        "addresses": addresses(),
    }


def releases(home: Path) -> list[str]:
    """Names of the installed releases, in the order in which they were installed."""
    found = []
    for path in home.glob("releases/*/number"):
        name = path.parent.name
        if name != "current" and not name.endswith(".part"):
            try:
                found.append((int(path.read_text()), name))
            except (OSError, ValueError):
                continue  # the installer clears away what is not whole
    return [name for _, name in sorted(found)]


def addresses() -> list[tuple[str, str]]:
    """Interface and address by which the box can be reached from elsewhere: IPv4, then IPv6."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for _, name in socket.if_nameindex():
            try:
                said = fcntl.ioctl(asking, _GET_ADDRESS, struct.pack("256s", name.encode()))
            except OSError:
                continue  # it has none
            found.append((name, socket.inet_ntoa(said[20:24])))
    lines = _IPV6.read_text().splitlines() if _IPV6.exists() else []
    for number, _, _, scope, _, name in map(str.split, lines):
        if scope != _LINK_LOCAL:
            found.append((name, str(ipaddress.IPv6Address(int(number, 16)))))
    return [(name, one) for name, one in found if not ipaddress.ip_address(one).is_loopback]
