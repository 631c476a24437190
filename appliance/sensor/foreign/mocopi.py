"""Sony mocopi's datagrams as bones of VMC: chunks of length, name and content, one inside the other."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import pairwise

from appliance.show.programs import MOCOPI_BONES

_HEAD = struct.Struct("<I4s")
_TURN = struct.Struct("<7f")  # rotation x, y, z, w, then the position in metres
_OUTER = (b"fram", b"btrs", b"btdt")
_STARTS = {"l_shoulder": "torso_7", "r_shoulder": "torso_7", "l_up_leg": "root", "r_up_leg": "root"}
MOCOPI_PARENTS = {name: _STARTS.get(name, above) for above, name in pairwise(MOCOPI_BONES)}
_MOST_BONES = 64


def mocopi_messages(received: bytes) -> list[tuple[str, list[object]]]:
    """The bones of one frame as messages (name, position, rotation); none for other datagrams.

    Raises ValueError for other bytes. Each step goes forward, so the datagram's length bounds the time.
    """
    bones: list[tuple[str, list[object]]] = []
    number: int | None = None
    for name, content in _chunks(received):
        if name == b"bnid" and len(content) == 2:
            number = int.from_bytes(content, "little")
        elif name == b"tran" and len(content) == _TURN.size and number is not None:
            x, y, z, w, *place = _TURN.unpack(content)
            if number < len(MOCOPI_BONES) and len(bones) < _MOST_BONES:
                bones.append(("/VMC/Ext/Bone/Pos", [MOCOPI_BONES[number], *place, x, y, z, w]))
            number = None
    return bones


def _chunks(data: bytes, depth: int = 0) -> Iterator[tuple[bytes, bytes]]:
    """The innermost chunks of a frame, in their order."""
    at = 0
    while at < len(data):
        if at + _HEAD.size > len(data):
            raise ValueError("This is no datagram of mocopi.")
        length, name = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if length > len(data) - at or not name.isalpha() or depth > len(_OUTER):
            raise ValueError("This is no datagram of mocopi.")
        content = data[at : at + length]
        at += length
        if name in _OUTER:
            yield from _chunks(content, depth + 1)
        else:
            yield name, content
