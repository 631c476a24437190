"""Orders: what show control asks of the stage, the projector and the lights, and what they answer.

Unix datagrams in JSON through sockets in the runtime folder; nobody waits for anybody.
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
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from appliance.sensor.keys import SensorKey

Place = Literal["stage", "projector", "lights"]
Delivery = Literal["sent", "full", "absent"]  # full: too many wait there already; absent: nobody is there
ANSWERS = "control"
_LARGEST = 65536
# What reading a datagram raises that nobody of this box has sent.
_NONSENSE = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)


@dataclass(frozen=True, slots=True)
class Order:
    """One thing to do, within its bounds; names that only the show knows are the receiver's to check.

    For the stage:  jump (s), excerpt (start s[, end s]), hold (x, y, z, angle; text: joint), release (text:
    joint), neutral, heading, strobe (text: the sensor or ""), reload (keys).
    For the projector:  corner (number 1..4, x, y), corners (x1, y1 .. x4, y4), corners/reset, brightness (b),
    mirror (0|1), grid (0|1), info (0|1).

    keys: what a reload has read. ask: who waits for an answer; 0: nobody.
    quiet: the asker is told of a refusal alone, not that it was done (streams of orders).
    until: monotonic seconds; after it it is not to be done: the asker is told so a moment later.
    """

    name: str
    values: tuple[float, ...] = ()
    text: str = ""
    keys: Mapping[str, SensorKey] = field(default_factory=dict, compare=False, repr=False)
    ask: int = field(default=0, compare=False)
    quiet: bool = field(default=False, compare=False)
    until: float = field(default=float("inf"), compare=False)


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of an order: whether it was done, and a sentence for whoever asked."""

    ask: int
    done: bool
    words: str


class OrderInbox:
    """A place's end: orders wait in its socket until it takes them. Raises OSError without a place for it."""

    def __init__(self, folder: Path, place: Place, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._socket = _Mailbox(folder, place)
        self._monotonic = monotonic

    def fileno(self) -> int:
        """For whoever sleeps until something comes."""
        return self._socket.fileno()

    def take(self) -> Order | None:
        """The oldest order that is still wanted, or None; never blocks, never raises.

        The clock is read after the order has come: a process that hung for a while in the middle of its turn
        still holds a time of before.
        """
        while (received := self._socket.take()) is not None:
            order = _parsed(received)
            if order is not None and self._monotonic() <= order.until:
                return order
        return None

    def answer(self, order: Order, done: bool, words: str) -> None:
        """Tell who asked, if anyone waits; never blocks, never raises."""
        if order.ask:
            answer = {"ask": order.ask, "done": done, "words": words}
            self._socket.send(ANSWERS, json.dumps(answer).encode())

    def close(self) -> None:
        """Take no more."""
        self._socket.close()


class OrderSender:
    """Show control's end. Raises OSError without a place for its socket."""

    def __init__(self, folder: Path) -> None:
        self._socket = _Mailbox(folder, ANSWERS)

    def fileno(self) -> int:
        """For whoever sleeps until an answer comes."""
        return self._socket.fileno()

    def send(self, to: Place, order: Order) -> Delivery:
        """Hand it over; never blocks, never raises."""
        return self._socket.send(to, _payload(order))

    def take(self) -> Answer | None:
        """The oldest answer that waits, or None; never blocks, never raises."""
        while (received := self._socket.take()) is not None:
            with contextlib.suppress(*_NONSENSE):
                values = json.loads(received)
                return Answer(int(values["ask"]), bool(values["done"]), str(values["words"]))
        return None

    def close(self) -> None:
        """Take no more."""
        self._socket.close()


class _Mailbox:
    """A Unix datagram socket in a folder, reached through /proc: a socket's own path ends after 107 bytes."""

    def __init__(self, folder: Path, place: str) -> None:
        self._folder = os.open(folder, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
        self._name = f"{place}.sock"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(self._name, dir_fd=self._folder)  # of a process that was killed
            self._socket.bind(self._path(self._name))
            self._inode = os.stat(self._name, dir_fd=self._folder).st_ino
        except OSError:
            self._socket.close()
            os.close(self._folder)
            raise

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
        values["keys"] = {name: [one.device_id, one.key.hex()] for name, one in order.keys.items()}
    return json.dumps(values).encode()


def _parsed(received: bytes) -> Order | None:
    """The order in a datagram; None for what nobody of this box has sent."""
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


def _keys(values: Mapping[str, Any]) -> dict[str, SensorKey]:
    if not values:
        return {}
    from appliance.sensor.keys import SensorKey  # reads YAML: show control starts sooner without it

    return {name: SensorKey(name, device, bytes.fromhex(key)) for name, (device, key) in values.items()}
