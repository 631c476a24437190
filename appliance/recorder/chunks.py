"""Chunks: what a segment file consists of, each proving by a checksum that it is whole."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from appliance.pose.foreign_file import opened

HEADER, KEYFRAME, LOG = 1, 2, 3  # kinds
_MAGIC = b"bkj2"
_HEAD = struct.Struct("<4sHHIII")  # magic, kind, ticks in it, bytes stored, bytes unpacked, CRC-32 of it all
_CHECK_AT = _HEAD.size - 4
# Bytes unpacked, by kind: 80 s of a figure of a thousand joints; a header becomes some ten times as much.
_LARGEST = {HEADER: 1 << 20, KEYFRAME: 1 << 22, LOG: 1 << 26}
_LEVEL = 1  # zlib level: poses are noise to it, silent fields cost nothing


@dataclass(frozen=True)
class Chunk:
    """Its kind, how many ticks are in it, and its bytes."""

    kind: int
    ticks: int
    data: bytes


def chunk(kind: int, data: bytes, ticks: int = 0) -> bytes:
    """A chunk as stored in a file."""
    stored = zlib.compress(data, _LEVEL)
    head = _HEAD.pack(_MAGIC, kind, ticks, len(stored), len(data), 0)[:_CHECK_AT]
    check = zlib.crc32(stored, zlib.crc32(head))
    return head + check.to_bytes(4, "little") + stored


def is_segment(data: bytes) -> bool:
    """Whether these first bytes of a file are those of a segment."""
    return data[: len(_MAGIC)] == _MAGIC


def chunks(data: bytes) -> Iterator[Chunk]:
    """All whole chunks from the start on; a torn one and what is behind it are left out."""
    at = 0
    while (found := _whole(data, at)) is not None:
        one, at = found
        yield one


def count_ticks(path: Path) -> int:
    """Number of ticks in a segment, from the heads of its chunks only. Raises OSError."""
    count = 0
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            magic, _, ticks, stored, _, _ = _HEAD.unpack(head)
            if magic != _MAGIC or file.seek(stored, os.SEEK_CUR) > size:
                break
            count += ticks
    return count


def _whole(data: bytes, at: int) -> tuple[Chunk, int] | None:
    if at + _HEAD.size > len(data):
        return None
    magic, kind, ticks, stored_bytes, raw_bytes, check = _HEAD.unpack_from(data, at)
    begin, end = at + _HEAD.size, at + _HEAD.size + stored_bytes
    if magic != _MAGIC or end > len(data) or raw_bytes > _LARGEST.get(kind, _LARGEST[LOG]):
        return None
    stored = data[begin:end]
    if zlib.crc32(stored, zlib.crc32(data[at : at + _CHECK_AT])) != check:
        return None
    data_bytes = _unpacked(stored, raw_bytes)
    return None if data_bytes is None else (Chunk(kind, ticks, data_bytes), end)


def _unpacked(stored: bytes, size: int) -> bytes | None:
    """So many bytes and no more, whatever the file's maker has put in; None where there are others."""
    try:
        found = zlib.decompressobj().decompress(stored, max(size, 1))
    except zlib.error:
        return None
    return found if len(found) == size else None
