"""Keyframes: the whole state of the dance as bytes, plain values in JSON and arrays behind them."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

POSITION = struct.Struct("<Q")  # before a keyframe stands how many entries of the log came before it
_HEAD = struct.Struct("<I")  # bytes of the JSON
_ARRAY = "\0array"  # a key that no state has


def packed(state: dict[str, Any]) -> bytes:
    """A state of numbers, text, lists, tuples, None, dictionaries and arrays. Raises TypeError for others."""
    arrays: list[bytes] = []

    def plain(value: Any) -> Any:
        if not isinstance(value, np.ndarray):
            raise TypeError(f"A keyframe cannot hold a {type(value).__name__}")
        arrays.append(np.ascontiguousarray(value).tobytes())
        return {_ARRAY: [value.dtype.str, value.shape]}

    words = json.dumps(state, default=plain).encode()
    return b"".join((_HEAD.pack(len(words)), words, *arrays))


def unpacked(data: bytes) -> dict[str, Any]:
    """The state in these bytes; tuples come back as lists. Raises ValueError for invalid ones."""
    (length,) = _HEAD.unpack_from(data)
    at = _HEAD.size + length

    def whole(found: dict[str, Any]) -> Any:
        nonlocal at
        if _ARRAY not in found:
            return found
        form, shape = found[_ARRAY]
        array = np.frombuffer(data, form, int(np.prod(shape)), at).reshape(shape)
        at += array.nbytes
        return array

    state: dict[str, Any] = json.loads(data[_HEAD.size : at], object_hook=whole)
    return state
