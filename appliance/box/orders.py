"""Orders: what show control asks the stage, the projector and the lights to do once, and their answers.

Unix datagrams in JSON through sockets in the runtime folder; no end ever blocks.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from appliance.box.runtime_folder import hold, is_lost
from appliance.levers.addresses import Receiver

Key = tuple[int, bytes]  # a sensor's device id and its secret
Delivery = Literal["sent", "full", "absent"]  # full: the receiver's socket is; absent: there is no receiver
ANSWERS = "control"
_LARGEST = 65536
_FOLDER = os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC
# Exceptions that parsing a foreign datagram may raise.
_NONSENSE = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)


@dataclass(frozen=True, slots=True)
class Order:
    """One thing to do, within its bounds; the receiver checks names that only the show knows.

    For the stage:  jump (s), excerpt (start s[, end s]), hold (x, y, z, angle; text: joint), place (x, y, z
    in metres[, s until it is let go]; text: joint), release (text: joint), neutral, heading, strobe (text:
    the sensor or ""), reload (keys).
    For the projector:  corner (number 1..4, x, y), corners (x1, y1 .. x4, y4), corners/reset, brightness (b),
    mirror (0|1), grid (0|1), info (0|1).
    For the lights:  walk (text: the fixture or "" for all), walk/stop.
    For the generator:  keep (text: the name).

    keys: those that a reload has read. ask: number of the answer that is waited for; 0: none.
    quiet: only a refusal is answered (streams of orders). until: monotonic seconds, after which the order
    is void.
    """

    name: str
    values: tuple[float, ...] = ()
    text: str = ""
    keys: Mapping[str, Key] = field(default_factory=dict, compare=False, repr=False)
    ask: int = field(default=0, compare=False)
    quiet: bool = field(default=False, compare=False)
    until: float = field(default=float("inf"), compare=False)


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to an order: whether it was done, and a sentence for people."""

    ask: int
    done: bool
    message: str


class OrderInbox:
    """The receiver's end: orders wait in its socket. Raises OSError where the folder takes no socket."""

    def __init__(
        self, folder: Path, place: Receiver, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._socket = _Mailbox(folder, place)
        self._monotonic = monotonic

    def fileno(self) -> int:
        """To poll for orders."""
        return self._socket.fileno()

    def take(self) -> Order | None:
        """The oldest order that is not void, or None; never blocks, never raises.

        The clock is read after the order was received: a process that hung in the middle of its turn would
        compare with an old time.
        """
        while (received := self._socket.take()) is not None:
            order = _parsed(received)
            if order is not None and self._monotonic() <= order.until:
                return order
        return None

    def answer(self, order: Order, done: bool, message: str) -> None:
        """Send the answer, if one is waited for; never blocks, never raises."""
        if order.ask:
            answer = {"ask": order.ask, "done": done, "message": message}
            self._socket.send(ANSWERS, json.dumps(answer).encode())

    def close(self) -> None:
        self._socket.close()


class OrderSender:
    """Show control's end. Raises OSError where the folder takes no socket."""

    def __init__(self, folder: Path) -> None:
        self._socket = _Mailbox(folder, ANSWERS)

    def fileno(self) -> int:
        """To poll for answers."""
        return self._socket.fileno()

    def send(self, to: Receiver, order: Order) -> Delivery:
        """Send an order; never blocks, never raises."""
        return self._socket.send(to, _payload(order))

    def take(self) -> Answer | None:
        """The oldest answer that waits, or None; never blocks, never raises."""
        while (received := self._socket.take()) is not None:
            with contextlib.suppress(*_NONSENSE):
                values = json.loads(received)
                return Answer(int(values["ask"]), bool(values["done"]), str(values["message"]))
        return None

    def close(self) -> None:
        self._socket.close()


class _Mailbox:
    """A Unix datagram socket in a folder, reached through /proc: a socket's own path ends after 107 bytes."""

    def __init__(self, folder: Path, place: str) -> None:
        self._whole = folder
        self._folder = os.open(folder, _FOLDER)
        self._name = f"{place}.sock"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(self._name, dir_fd=self._folder)  # left by a process that was killed
            self._bind(self._socket)
        except OSError:
            self._socket.close()
            os.close(self._folder)
            raise
        hold(self)

    def _bind(self, one: socket.socket) -> None:
        one.bind(self._path(self._name))
        self._inode = os.stat(self._name, dir_fd=self._folder).st_ino

    def renew(self) -> bool:
        """Where the socket or its folder was deleted: another one in its place, with the same descriptor."""
        if self._socket.fileno() < 0 or not is_lost(self._whole / self._name):
            return False
        folder = os.open(self._whole, _FOLDER)
        os.close(self._folder)
        self._folder = folder
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as made:
            self._bind(made)
            os.dup2(made.fileno(), self._socket.fileno(), inheritable=False)
        return True

    def fileno(self) -> int:
        return self._socket.fileno()

    def take(self) -> bytes | None:
        try:
            return self._socket.recv(_LARGEST)
        except OSError:
            return None

    def send(self, place: str, payload: bytes) -> Delivery:
        try:
            self._socket.sendto(payload, self._path(f"{place}.sock"))
        except BlockingIOError:
            return "full"
        except OSError:
            return "absent"
        return "sent"

    def close(self) -> None:
        with contextlib.suppress(OSError):
            if os.stat(self._name, dir_fd=self._folder).st_ino == self._inode:  # not that of a successor
                os.unlink(self._name, dir_fd=self._folder)
        self._socket.close()
        os.close(self._folder)

    def _path(self, name: str) -> str:
        return f"/proc/self/fd/{self._folder}/{name}"


def _payload(order: Order) -> bytes:
    values: dict[str, Any] = {
        "name": order.name,
        "values": order.values,
        "text": order.text,
        "ask": order.ask,
        "quiet": order.quiet,
        "until": order.until,
    }
    if order.keys:
        values["keys"] = {name: [device, key.hex()] for name, (device, key) in order.keys.items()}
    return json.dumps(values).encode()


def _parsed(received: bytes) -> Order | None:
    """The order in a datagram; None for anything else."""
    try:
        values = json.loads(received)
        return Order(
            name=str(values["name"]),
            values=_finite(values["values"]),
            text=str(values["text"]),
            keys=_keys(values.get("keys", {})),
            ask=int(values["ask"]),
            quiet=bool(values["quiet"]),
            until=float(values["until"]),
        )
    except _NONSENSE:
        return None


def _finite(values: Sequence[Any]) -> tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not a number")
    return numbers


def _keys(values: Mapping[str, Any]) -> dict[str, Key]:
    return {name: (int(device), bytes.fromhex(key)) for name, (device, key) in values.items()}
