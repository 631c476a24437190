"""Reads the box's journal by its documented layout (docs/journal.md), not by the box's own code."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

CHUNK = struct.Struct("<4sHHIII")  # magic, kind, ticks, bytes stored, bytes unpacked, CRC-32
ENTRY = struct.Struct("<QII")  # number, kind, bytes
HEADER, LOG, TICK = 1, 3, 1


def read_journal(folder: Path) -> tuple[dict[str, Any], NDArray[Any]]:
    """The box's flight recorder, by what its header says of itself."""
    header: dict[str, Any] = {}
    records: list[bytes] = []
    for segment in sorted(folder.glob("*.segment")):
        for kind, data in _chunks(segment.read_bytes()):
            if kind == HEADER:
                header = json.loads(data)
            elif kind == LOG:
                records += _records(data)
    layout = np.dtype([(name, form, tuple(shape)) for name, form, shape in header["record"]])
    return header, np.frombuffer(b"".join(records), layout)


def _chunks(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Kind and unpacked bytes of each piece of a segment: docs/journal.md."""
    at = 0
    while at + CHUNK.size <= len(data):
        _, kind, _, stored, _, _ = CHUNK.unpack_from(data, at)
        at += CHUNK.size
        yield kind, zlib.decompress(data[at : at + stored])
        at += stored


def _records(data: bytes) -> Iterator[bytes]:
    """The ticks among the entries of a piece."""
    at = 0
    while at < len(data):
        _, kind, size = ENTRY.unpack_from(data, at)
        at += ENTRY.size
        if kind == TICK:
            yield data[at : at + size]
        at += size
