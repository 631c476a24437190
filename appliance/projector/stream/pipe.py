"""Messages between the projector and its stream's process: pictures, and requests for one."""

from __future__ import annotations

import struct
from typing import BinaryIO

HEAD = struct.Struct("<II")  # width and height, before each picture's bytes: four a pixel, top row first
WANTED = b"w"  # a byte for each picture that is wanted
ALIVE = b"."  # its other end: the process that serves works
MOST_PIXELS = 16384 * 16384

Picture = tuple[int, int, bytes]


def head(size: tuple[int, int]) -> bytes:
    """The header of a picture of that size."""
    return HEAD.pack(*size)


def read_picture(pipe: BinaryIO) -> Picture | None:
    """The next picture; None at the end. Raises ValueError for an invalid one."""
    first = pipe.read(HEAD.size)
    if len(first) < HEAD.size:
        return None
    width, height = HEAD.unpack(first)
    if not 0 < width * height <= MOST_PIXELS:
        raise ValueError(f"A picture of {width}x{height} pixels.")
    pixels = pipe.read(4 * width * height)
    return (width, height, pixels) if len(pixels) == 4 * width * height else None
