"""Floods of the control port, until killed: `python -m tests.show_control.flood PORT KIND`."""

from __future__ import annotations

import contextlib
import socket
import sys
import time
from collections.abc import Iterator
from itertools import islice

from tests.show_control.doubles import HOST
from tests.show_control.fuzz import bundle, datagrams, message

RATE_HZ, AT_ONCE = 10_000, 20
STRANGERS = "strangers"
KINDS = {
    "questions": [message("/sensors/list")],
    "pings": [message("/ping")],
    "orders": [message("/player/jump", 1.0), message("/mocap/setjointrot", "lShldr", 0.0, 1.0, 0.0, 1.5)],
    "malformed": [one for one in islice(datagrams(5, 400), 400) if len(one) < 4096],
    "bundles": [bundle(*[message("/status"), message("/ping")] * 30)],
    STRANGERS: [message("/panic")],
}


def stranger() -> str:
    """An address of this machine that may not command, unless it is listed; "" where there is none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one, contextlib.suppress(OSError):
        one.connect(("192.0.2.1", 9))  # sends nothing
        return str(one.getsockname()[0])
    return ""


def flood(port: int, kind: str) -> None:
    """Never returns; what this machine does not manage in time is left out."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind((stranger() if kind == STRANGERS else HOST, 0))
        for number, due in enumerate(_grid(AT_ONCE / RATE_HZ)):
            time.sleep(max(0.0, due - time.monotonic()))
            if number == 1:
                print("begun", flush=True)
            for place in range(AT_ONCE):
                one.sendto(KINDS[kind][(number * AT_ONCE + place) % len(KINDS[kind])], (HOST, port))


def _grid(every_s: float) -> Iterator[float]:
    due = time.monotonic()
    while True:
        yield due
        due = max(due + every_s, time.monotonic() - every_s)


if __name__ == "__main__":
    flood(int(sys.argv[1]), sys.argv[2])
