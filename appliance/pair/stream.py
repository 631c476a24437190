"""Numbered messages over datagrams that may be lost, repeated or out of order; also whole keyframes."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

from appliance.pair.wire import MOST_BODY

_PART = struct.Struct("<IHH")  # number of the message, part, parts
_NUMBERS = struct.Struct("<I")
MOST_PART = MOST_BODY - _PART.size
KEPT = 512  # messages that can be asked for again: 10 s of ticks
MOST_PARTS = 4096
ASK_AGAIN_S = 0.015
_MOST_ASKED = 64


def count_of(message: bytes) -> int:
    """How many bodies a message has."""
    return max(1, -(-len(message) // MOST_PART))


def parts_of(number: int, message: bytes, wanted: Iterable[int] | None = None) -> Iterator[bytes]:
    """A message as bodies of datagrams: all of them, or those of these places."""
    parts = count_of(message)
    for part in range(parts) if wanted is None else wanted:
        if part < parts:
            yield _PART.pack(number, part, parts) + message[part * MOST_PART : (part + 1) * MOST_PART]


class Outgoing:
    """The leader's end: messages are numbered from 1 and kept for a while."""

    def __init__(self) -> None:
        self.number = 0  # the newest message's number
        self._kept: dict[int, bytes] = {}

    def put(self, message: bytes) -> Iterator[bytes]:
        """The next message, as bodies."""
        self.number += 1
        self._kept[self.number] = message
        self._kept.pop(self.number - KEPT, None)
        return parts_of(self.number, message)

    def again(self, number: int) -> Iterator[bytes]:
        """The same once more; nothing of one that is not kept any longer."""
        message = self._kept.get(number)
        return iter(()) if message is None else parts_of(number, message)


class Parts:
    """One message while its parts come in."""

    def __init__(self, parts: int) -> None:
        self._parts: list[bytes | None] = [None] * parts
        self._missing = parts

    def put(self, part: int, payload: bytes) -> None:
        if self._parts[part] is None:
            self._parts[part] = payload
            self._missing -= 1

    @property
    def parts(self) -> int:
        """How many it has."""
        return len(self._parts)

    @property
    def missing(self) -> list[int]:
        """Places of the parts that have not come."""
        return [place for place, one in enumerate(self._parts) if one is None] if self._missing else []

    @property
    def whole(self) -> bytes | None:
        """The message once it is complete."""
        return None if self._missing else b"".join(one for one in self._parts if one is not None)


def part_in(body: bytes) -> tuple[int, int, int, bytes] | None:
    """Number, part, parts and payload of a body; None for anything else."""
    if len(body) < _PART.size:
        return None
    number, part, parts = _PART.unpack_from(body)
    return (number, part, parts, body[_PART.size :]) if part < parts <= MOST_PARTS else None


class Incoming:
    """The follower's end: messages in order, and which ones are missing."""

    def __init__(self) -> None:
        self.next = 1  # number of the message that `take` gives next
        self.newest = 0  # the highest number that was heard of
        self._open: dict[int, Parts] = {}
        self._asked_at: dict[int, float] = {}

    def begin_at(self, number: int) -> None:
        """Go on with this message; what came before it is forgotten."""
        self.next = number
        for one in [one for one in self._open if one < number]:
            del self._open[one]
        self._asked_at.clear()

    def restart(self) -> None:
        """Another leader, or another start of it: its numbers begin anew."""
        self.next, self.newest = 1, 0
        self._open.clear()
        self._asked_at.clear()

    def put(self, body: bytes) -> None:
        """The body of a datagram."""
        found = part_in(body)
        if found is None:
            return
        number, part, parts, payload = found
        self.newest = max(self.newest, number)
        if not self.next <= number < self.next + KEPT:
            return
        known = self._open.get(number)
        if known is None:
            known = self._open[number] = Parts(parts)
        if known.parts == parts:
            known.put(part, payload)

    @property
    def is_lost(self) -> bool:
        """Whether more is missing than the leader keeps."""
        return self.newest - self.next >= KEPT - 1

    def take(self) -> bytes | None:
        """The next message, once it is whole."""
        known = self._open.get(self.next)
        whole = None if known is None else known.whole
        if whole is not None:
            del self._open[self.next]
            self._asked_at.pop(self.next, None)
            self.next += 1
        return whole

    def take_rest(self) -> Iterator[bytes]:
        """The leader is gone: what has come of its messages, in order, without those that are missing."""
        for number in sorted(self._open):
            if (whole := self._open[number].whole) is not None:
                yield whole
        self.begin_at(self.newest + 1)

    def missing(self, now: float) -> list[int]:
        """Numbers to ask for now: of messages older than the newest, or of which a part is missing."""
        wanted = []
        for number in range(self.next, min(self.newest + 1, self.next + _MOST_ASKED)):
            known = self._open.get(number)
            if known is not None and not known.missing:
                continue
            asked_at = self._asked_at.setdefault(
                number, now - ASK_AGAIN_S / 2
            )  # its repeat may be on the way
            if now - asked_at >= ASK_AGAIN_S:
                self._asked_at[number] = now
                wanted.append(number)
        return wanted


def numbers_in(body: bytes) -> list[int]:
    """The numbers in the body of a question."""
    return [number for (number,) in _NUMBERS.iter_unpack(body[: len(body) // 4 * 4])]


def body_of(numbers: Iterable[int]) -> bytes:
    """Numbers as the body of a question."""
    return b"".join(map(_NUMBERS.pack, numbers))
