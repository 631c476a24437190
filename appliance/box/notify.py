"""Notifies a supervisor: ready, still alive, what is going on, about to end (sd_notify(3)).

systemd on an installed box, `bunraku play` for its companions: each process is watched the same in both.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from collections.abc import Iterator, Mapping

# How long a process may give no sign before it is started again, seconds; its unit says the same.
WATCHDOG_S = {
    "control": 2.0,
    "lights": 2.0,
    "generator": 5.0,
    "console": 5.0,
    "sound": 5.0,
    "remote": 5.0,
    "keeper": 8.0,
    "projector": 10.0,
}
READY, ALIVE, ENDING = "READY=1", "WATCHDOG=1", "STOPPING=1"
_PINGS_IN_A_PERIOD = 4
_SENDER = struct.Struct("3i")  # struct ucred: process, user, group
_LARGEST = 4096


class Notifier:
    """Tells the supervisor how this process is; does nothing without one, never raises, never waits.

    Takes $NOTIFY_SOCKET, $WATCHDOG_USEC and $WATCHDOG_PID, which systemd sets for a unit with Type=notify
    and WatchdogSec=. A word for which there is no room at the moment is lost; READY comes again.
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
        self._owed = "" if self._send(READY, status) else f"{READY}\n"

    def ping(self, now: float) -> None:
        """It still works; monotonic seconds. Call it often: sent four times a period."""
        if now >= self._due and self._socket is not None and self.every_s != float("inf"):
            self._due = now + self.every_s
            if self._send(f"{self._owed}{ALIVE}"):
                self._owed = ""

    def status(self, message: str) -> None:
        """One line for `systemctl status`."""
        self._send("", message)

    def stopping(self) -> None:
        """It ends by itself now."""
        self._send(ENDING)

    def close(self) -> None:
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


class NotifyListener:
    """The supervisor's end, for children of this process. Raises OSError without a socket."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self._socket.bind("")  # a free name in the abstract space, which the kernel chooses

    def environ(self, watchdog_s: float) -> dict[str, str]:
        """The environment by which a child finds it."""
        name = self._socket.getsockname()[1:]
        return {"NOTIFY_SOCKET": f"@{os.fsdecode(name)}", "WATCHDOG_USEC": str(round(watchdog_s * 1e6))}

    def heard(self) -> Iterator[tuple[int, str]]:
        """Sender's process and message of all that waits; the kernel tells the process."""
        while True:
            try:
                message, credentials, _, _ = self._socket.recvmsg(_LARGEST, socket.CMSG_SPACE(_SENDER.size))
            except OSError:
                return
            for level, kind, sender in credentials:
                if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS):
                    yield _SENDER.unpack(sender)[0], message.decode(errors="replace")

    def close(self) -> None:
        self._socket.close()


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
