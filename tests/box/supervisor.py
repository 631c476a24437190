"""systemd's end of what a process tells it: a real socket, and the environment that leads there."""

from __future__ import annotations

import socket
import time


class Supervisor:
    """A datagram socket in the file system, or in the abstract space where the address begins with @."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self.environ = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "1000000"}

    def heard(self) -> list[str]:
        """All that came until now, one entry a datagram."""
        self.socket.setblocking(False)
        messages = []
        while True:
            try:
                messages.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return messages

    def waits_for(self, word: str, within_s: float) -> str:
        """The next datagram that begins with `word`; raises TimeoutError when none comes."""
        until = time.monotonic() + within_s
        while (left_s := until - time.monotonic()) > 0:
            self.socket.settimeout(left_s)
            if (message := self.socket.recv(4096).decode()).startswith(word):
                return message
        raise TimeoutError(f"{word} was not heard within {within_s:g} s")

    def close(self) -> None:
        self.socket.close()
