"""Reads the box's journal by its documented layout (docs/journal.md), not by the box's own code."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

CHUNK = struct.Struct("<4sHHIII")  # magic, kind, ticks, bytes stored, bytes unpacked, CRC-32
ENTRY = struct.Struct("<QII")  # number, kind, bytes
MAGIC = b"bkj2"
HEADER, LOG, TICK = 1, 3, 1


class Journal(NamedTuple):
    """The flight recorder. ticks: records as the header lays them out; gaps: entries that are missing."""

    header: dict[str, Any]
    ticks: NDArray[Any]
    gaps: int


def read_journal(folder: Path) -> Journal:
    """By what its header says of itself. Raises ValueError for a damaged one, or one without a header."""
    header: dict[str, Any] = {}
    records: list[bytes] = []
    numbers: list[int] = []
    for segment in sorted(folder.glob("*.segment")):
        for kind, data in _chunks(segment.read_bytes()):
            if kind == HEADER:
                header = json.loads(data)
            elif kind == LOG:
                for number, entry, content in _entries(data):
                    numbers.append(number)
                    records += [content] if entry == TICK else []
    if not header:
        raise ValueError(f"{folder}: the box wrote no journal.")
    layout = np.dtype([(name, form, tuple(shape)) for name, form, shape in header["record"]])
    gaps = max(numbers, default=0) - min(numbers, default=1) + 1 - len(numbers)
    return Journal(header, np.frombuffer(b"".join(records), layout), gaps)


def _chunks(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Kind and unpacked bytes of each piece of a segment: docs/journal.md."""
    at = 0
    while at + CHUNK.size <= len(data):
        magic, kind, _, stored, _, check = CHUNK.unpack_from(data, at)
        head, content = data[at : at + CHUNK.size - 4], data[at + CHUNK.size : at + CHUNK.size + stored]
        if magic != MAGIC or zlib.crc32(head + content) != check:
            raise ValueError(f"The journal is damaged at byte {at} of a segment.")
        at += CHUNK.size + stored
        yield kind, zlib.decompress(content)


def _entries(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Number, kind and content of each entry of a piece."""
    at = 0
    while at < len(data):
        number, kind, size = ENTRY.unpack_from(data, at)
        at += ENTRY.size
        yield number, kind, data[at : at + size]
        at += size
