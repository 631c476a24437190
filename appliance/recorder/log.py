"""The log of a run: ticks and events in the order in which they happened, numbered from 1."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

POSITION = struct.Struct("<Q")  # before a keyframe: how many entries of the log came before it
_HEAD = struct.Struct("<QII")  # number, kind, bytes
_PIECE = struct.Struct("<HH")  # which piece of a long event, of how many; they follow each other


@dataclass(frozen=True, slots=True)
class Entry:
    """A tick (its record) or an event (JSON); `number` counts both."""

    number: int
    kind: int  # record.TICK, record.EVENT, record.PIECE
    data: bytes


def packed(entries: Sequence[Entry]) -> bytes:
    """Entries as stored in a chunk."""
    return b"".join(
        part for one in entries for part in (_HEAD.pack(one.number, one.kind, len(one.data)), one.data)
    )


def unpacked(data: bytes) -> Iterator[Entry]:
    """The entries of a chunk, as far as they are whole."""
    at = 0
    while at + _HEAD.size <= len(data):
        number, kind, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if length > len(data) - at:
            return
        yield Entry(number, kind, data[at : at + length])
        at += length


def pieces_of(event: bytes, most_bytes: int) -> Iterator[bytes]:
    """A long event as the data of several entries, each of `most_bytes` at most."""
    size = most_bytes - _PIECE.size
    count = -(-len(event) // size)
    for place in range(count):
        yield _PIECE.pack(place, count) + event[place * size : (place + 1) * size]


class Pieces:
    """Puts long events together, whichever segments hold their pieces."""

    def __init__(self) -> None:
        self._pieces: dict[int, bytes] = {}

    def whole(self, piece: Entry) -> bytes | None:
        """The event that ends with this piece; None before its last one, or if one is lost.

        Raises struct.error or LookupError for what is no piece.
        """
        place, count = _PIECE.unpack_from(piece.data)
        self._pieces[piece.number] = piece.data[_PIECE.size :]
        numbers = range(piece.number - place, piece.number - place + count)
        if numbers[-1] != piece.number or not all(number in self._pieces for number in numbers):
            return None
        return b"".join(self._pieces.pop(number) for number in numbers)
