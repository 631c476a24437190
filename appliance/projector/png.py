"""A picture of the display as a PNG file (ISO/IEC 15948), for pictures without a display."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_EIGHT_BIT_RGBA = (8, 6, 0, 0, 0)
_FAST = 1  # compression: a picture must not take longer to write than to draw


def write_png(path: Path, pixels: bytes, width: int, height: int) -> None:
    """Write RGBA bytes as OpenGL gives them, bottom row first. Raises OSError."""
    row = 4 * width
    rows = (b"\x00" + pixels[at : at + row] for at in range((height - 1) * row, -1, -row))
    with path.open("wb") as file:
        file.write(_SIGNATURE)
        file.write(_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, *_EIGHT_BIT_RGBA)))
        file.write(_chunk(b"IDAT", zlib.compress(b"".join(rows), _FAST)))
        file.write(_chunk(b"IEND", b""))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
