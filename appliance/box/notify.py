"""Notifies systemd: ready, still alive, what is going on, about to end (sd_notify(3))."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping

_PINGS_IN_A_PERIOD = 4


class Notifier:
    """Tells systemd how this process is; does nothing without systemd, never raises, never waits.

    Takes $NOTIFY_SOCKET, $WATCHDOG_USEC and $WATCHDOG_PID, which systemd sets for a unit with Type=notify
    and WatchdogSec=. A word for which systemd has no room at the moment is lost; READY comes again.
    """

    def __init__(self, environ: Mapping[str, str] | None = None) -> None:
        environ = os.environ if environ is None else environ
        self._address = _address(environ.get("NOTIFY_SOCKET", ""))
        self._socket: socket.socket | None = None
        if self._address:
            with contextlib.suppress(OSError):
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
                self._socket.setblocking(False)
        self.every_s = _watchdog_s(environ) / _PINGS_IN_A_PERIOD
        """The longest pause between two pings, seconds; infinite where no watchdog waits for them."""
        self._due = 0.0
        self._owed = ""  # a lost READY would be the end of this process: it is said again with each ping

    def ready(self, status: str = "") -> None:
        """It works now."""
        self._owed = "" if self._send("READY=1", status) else "READY=1\n"

    def ping(self, now: float) -> None:
        """It still works; monotonic seconds. Call it often: sent four times a period."""
        if now >= self._due and self._socket is not None and self.every_s != float("inf"):
            self._due = now + self.every_s
            if self._send(f"{self._owed}WATCHDOG=1"):
                self._owed = ""

    def status(self, words: str) -> None:
        """One line for `systemctl status`."""
        self._send("", words)

    def stopping(self) -> None:
        """It ends by itself now."""
        self._send("STOPPING=1")

    def close(self) -> None:
        """Say nothing more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, word: str, status: str = "") -> bool:
        """Whether it was taken; True without systemd."""
        if self._socket is None:
            return True
        lines = [word] if word else []
        if status:
            lines.append("STATUS=" + " ".join(status.splitlines()))
        try:
            self._socket.sendto("\n".join(lines).encode(), self._address)
        except OSError:
            return False
        return True


def _address(named: str) -> str:
    """Where systemd listens: a path, or a name in the abstract space, which is written with an @."""
    return "\0" + named[1:] if named.startswith("@") else named


def _watchdog_s(environ: Mapping[str, str]) -> float:
    """The watchdog's period in seconds; infinite where there is none, or it watches another process."""
    if environ.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return float("inf")
    with contextlib.suppress(ValueError):
        if (period_s := int(environ.get("WATCHDOG_USEC", "0")) / 1e6) > 0:
            return period_s
    return float("inf")
