"""Vertices packed for the GPU: places as floats, everything else in bytes and half floats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

FORMATS = {  # moderngl's word for it, and numpy's
    "position": ("3f4", "f4"),
    "normal": ("4f1", "u1"),
    "tangent": ("4f1", "u1"),
    "calm": ("4f1", "u1"),
    "sunk": ("4f2", "f2"),
    "chance": ("4f2", "f2"),
    "along": ("4f2", "f2"),
    "joints": ("4u1", "u1"),
    "weights": ("4f1", "u1"),
}


def layout(parts: Mapping[str, Any]) -> tuple[str, ...]:
    """The layout of a vertex array with vertices of these parts: the format, then names in shaders."""
    formats = (_formats(part, values)[0] for part, values in parts.items())
    return " ".join(formats), *(f"in_{part}" for part in parts)


def packed(parts: Mapping[str, Any]) -> bytes:
    """Parts (V, ..) by name, vertex after vertex; what has fewer numbers than its format ends in zeros.

    Bytes hold 0 to 1, or -1 to 1 for directions; a shader doubles those and takes 1 away.
    """
    count = len(next(iter(parts.values())))
    formats = {part: _formats(part, values) for part, values in parts.items()}
    kinds: list[Any] = [(part, kind, int(word[0])) for part, (word, kind) in formats.items()]
    records = np.zeros(count, kinds)
    for part, values in parts.items():
        if part in ("normal", "tangent", "calm"):
            values = 0.5 + 0.5 * values
        if FORMATS[part][0].endswith("f1"):
            values = np.round(255.0 * values)
        records[part][:, : values.shape[1]] = values
    return records.tobytes()


def _formats(part: str, values: Any) -> tuple[str, str]:
    """FORMATS, and two bytes for the numbers of more joints than one holds."""
    return ("4u2", "u2") if part == "joints" and values.dtype.itemsize > 1 else FORMATS[part]
