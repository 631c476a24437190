"""The log of a run: ticks and events in the order in which they happened, numbered from 1."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

_HEAD = struct.Struct("<QII")  # number, kind, bytes


@dataclass(frozen=True, slots=True)
class Entry:
    """A tick (its record) or an event (JSON); `number` counts both."""

    number: int
    kind: int  # record.TICK, record.EVENT
    data: bytes


def packed(entries: Sequence[Entry]) -> bytes:
    """Entries as they lie in a chunk."""
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
