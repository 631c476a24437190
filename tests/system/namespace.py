"""Private networks for tests: Linux network namespaces, and a cable between two of them."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Self

_CLONE_NEWNET = 0x40000000
_numbers = itertools.count()


def why_not() -> str | None:
    """Why this machine cannot make networks; None if it can."""
    if shutil.which("ip") is None:
        return "the command ip (Debian package iproute2) is missing"
    name = _name("try")
    if _ip("netns", "add", name, check=False).returncode != 0:
        return "making a network namespace needs the right to administer networks (run the tests as root)"
    _ip("netns", "delete", name)
    return None


class Namespace:
    """A network with its own loopback interface, all ports free."""

    def __init__(self, what: str) -> None:
        self.name = _name(what)

    def __enter__(self) -> Self:
        _ip("netns", "add", self.name)
        _ip("-n", self.name, "link", "set", "lo", "up")
        return self

    def __exit__(self, *_: object) -> None:
        _ip("netns", "delete", self.name)

    def command(self, *arguments: str) -> list[str]:
        """A command line that runs inside."""
        return ["ip", "netns", "exec", self.name, *arguments]

    @contextlib.contextmanager
    def entered(self) -> Iterator[None]:
        """Inside, this thread opens its sockets in this network; they stay there."""
        with Path("/proc/thread-self/ns/net").open() as outside:
            with Path("/run/netns", self.name).open() as inside:
                _set_namespace(inside.fileno())
            try:
                yield
            finally:
                _set_namespace(outside.fileno())


class Cable:
    """Joins two networks until one of them is deleted. Addresses like 10.77.0.1/24."""

    def __init__(self, one: Namespace, one_address: str, two: Namespace, two_address: str) -> None:
        self._near, self._end = one, _name("a")
        far_end = _name("b")
        _ip("link", "add", self._end, "type", "veth", "peer", "name", far_end)
        for network, address, end in ((one, one_address, self._end), (two, two_address, far_end)):
            _ip("link", "set", end, "netns", network.name)
            _ip("-n", network.name, "address", "add", address, "dev", end)
            _ip("-n", network.name, "link", "set", end, "up")

    def pull_out(self) -> None:
        """Take down the first network's end."""
        _ip("-n", self._near.name, "link", "set", self._end, "down")

    def plug_in(self) -> None:
        """Bring it up again."""
        _ip("-n", self._near.name, "link", "set", self._end, "up")


def _name(what: str) -> str:
    """At most 15 letters, the limit for interfaces; different in each test run."""
    return f"bk{os.getpid() % 100000}{what[:6]}{next(_numbers)}"


def _ip(*arguments: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["ip", *arguments], capture_output=True, text=True, check=check)


def _set_namespace(descriptor: int) -> None:
    library = ctypes.CDLL(None, use_errno=True)
    if library.setns(descriptor, _CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "setns")
