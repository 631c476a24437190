"""The container of binary glTF 2.0: a JSON text and one buffer, and the typed arrays (accessors) in it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.exchange.exchange_error import ExchangeError
from appliance.pose.foreign_file import content, plain_json
from appliance.pose.quaternion import Array

_HEAD, _CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")
_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"
_LARGEST = 1 << 29  # bytes
_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_CODES = {np.dtype(form): code for code, form in _TYPES.items()}
_SHAPES: dict[str, tuple[int, ...]] = {
    "SCALAR": (),
    "VEC2": (2,),
    "VEC3": (3,),
    "VEC4": (4,),
    "MAT4": (4, 4),  # column by column
}
_SCALES = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}  # ranges of normalised integers


class GlbBuffer:
    """The buffer of a file that is being written, with its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """The number of a new accessor with this array (N, ...). target: 34962 vertices, 34963 indices."""
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        self.data += np.ascontiguousarray(array).tobytes()
        kind = next(name for name, shape in _SHAPES.items() if shape == array.shape[1:])
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": _CODES[array.dtype],
            "count": len(array),
            "type": kind,
        }
        if bounds:
            accessor["min"] = np.atleast_1d(array.min(axis=0)).tolist()
            accessor["max"] = np.atleast_1d(array.max(axis=0)).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def write(self, path: Path, document: dict[str, Any]) -> None:
        """Write the file: the document completed with the buffer."""
        self.data += bytes(-len(self.data) % 4)
        whole = document | {
            "buffers": [{"byteLength": len(self.data)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        size = _HEAD.size + 2 * _CHUNK.size + len(text) + len(self.data)
        head = _HEAD.pack(_MAGIC, 2, size)
        path.write_bytes(
            b"".join((head, _CHUNK.pack(len(text), _JSON), text, _CHUNK.pack(len(self.data), _BINARY)))
            + self.data
        )


class GlbFile:
    """A file that was read: its document, and its accessors as arrays. Raises ExchangeError or OSError."""

    def __init__(self, path: Path) -> None:
        self.path = path
        data = content(path, _LARGEST)
        if len(data) < _HEAD.size or data[:4] != _MAGIC:
            raise ExchangeError(path, "This is no binary glTF file. Export as .glb, not as .gltf.")
        _, version, _ = _HEAD.unpack_from(data)
        if version != 2:
            raise ExchangeError(path, f"This is glTF {version}; only glTF 2 is read.")
        chunks: dict[bytes, bytes] = {}
        at = _HEAD.size
        while at + _CHUNK.size <= len(data):
            length, kind = _CHUNK.unpack_from(data, at)
            at += _CHUNK.size
            if at + length > len(data):
                raise ExchangeError(path, "The file ends too early. Export or copy it again.")
            chunks.setdefault(kind, data[at : at + length])
            at += length
        try:
            self.document: dict[str, Any] = plain_json(chunks[_JSON])
        except (KeyError, ValueError) as error:
            raise ExchangeError(path, f"Its JSON part cannot be read ({error}).") from error
        self._binary = chunks.get(_BINARY, b"")

    def array(self, number: int) -> Array:
        """An accessor's values (N, ...); normalised integers as -1 to 1. Raises LookupError, ValueError."""
        accessor = self.document["accessors"][number]
        if "sparse" in accessor or "bufferView" not in accessor:
            raise ValueError("an array is stored sparsely, which is not read")
        view = self.document["bufferViews"][accessor["bufferView"]]
        if view.get("buffer", 0) != 0 or "uri" in self.document["buffers"][0]:
            raise ValueError("an array is in another file")
        form, shape = np.dtype(_TYPES[accessor["componentType"]]), _SHAPES[accessor["type"]]
        count, item = int(accessor["count"]), form.itemsize * int(np.prod(shape))
        start = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
        stride = int(view.get("byteStride", item))
        if start < 0 or count < 1 or stride < item or start + stride * (count - 1) + item > len(self._binary):
            raise ValueError("an array reaches beyond the file")
        raw = np.ndarray((count, item), np.uint8, self._binary, start, (stride, 1))
        values = np.ascontiguousarray(raw).view(form).reshape(count, *shape).astype(np.float64)
        if accessor.get("normalized"):
            values = np.maximum(values / _SCALES[accessor["componentType"]], -1.0)
        return values
