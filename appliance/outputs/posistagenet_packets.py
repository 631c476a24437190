"""PosiStageNet 2 packets laid out once, so that a tick only writes numbers into them (protocol v2.03)."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

MAX_PACKET = 1472  # bytes: Ethernet's 1500 less IP and UDP headers; the protocol itself allows 1500
VERSION = 2, 0
_DATA, _INFO = 0x6755, 0x6756
_PACKET_HEADER, _DATA_TRACKERS, _SYSTEM_NAME, _INFO_TRACKERS = 0, 1, 1, 2
_NAME, _POSITION, _SPEED, _STATUS = 0, 0, 1, 3
_PARENT = 0x8000  # the chunk has chunks inside
_CHUNK = struct.Struct("<HH")  # id; length in 15 bits and _PARENT
_STAMP = struct.Struct("<QBBBB")  # microseconds, version high and low, frame id, packets of this frame
_STAMP_AT = 2 * _CHUNK.size
_VECTOR = struct.Struct("<fff")
_VALID = struct.pack("<f", 1.0)


class Packets:
    """The packets of one frame, in buffers that stay the same; each kind counts its own frame ids."""

    def __init__(self, kind: int, bodies: Sequence[bytes]) -> None:
        self._buffers = [
            bytearray(_parent(kind, _chunk(_PACKET_HEADER, bytes(_STAMP.size)) + body)) for body in bodies
        ]
        self._views = tuple(memoryview(buffer) for buffer in self._buffers)
        self._frame_id = 0

    def stamped(self, time_us: int) -> Sequence[memoryview]:
        """Datagrams of the next frame; `time_us`: since the server's start."""
        for buffer in self._buffers:
            _STAMP.pack_into(buffer, _STAMP_AT, time_us, *VERSION, self._frame_id, len(self._buffers))
        self._frame_id = (self._frame_id + 1) & 0xFF
        return self._views


class DataPackets(Packets):
    """PSN_DATA: for each tracker a position, if wanted a speed, and the status 1 (valid)."""

    def __init__(self, trackers: Sequence[int], with_speed: bool) -> None:
        fields = _chunk(_POSITION, bytes(_VECTOR.size))
        speed_at = _CHUNK.size + len(fields) + _CHUNK.size
        if with_speed:
            fields += _chunk(_SPEED, bytes(_VECTOR.size))
        fields += _chunk(_STATUS, _VALID)
        bodies = _split(_DATA_TRACKERS, [_parent(tracker, fields) for tracker in trackers], before=b"")
        super().__init__(_DATA, bodies)
        self._positions = self._vectors(2 * _CHUNK.size, _CHUNK.size + len(fields))
        self._speeds = self._vectors(speed_at, _CHUNK.size + len(fields)) if with_speed else []

    def fill(self, positions: NDArray[np.float32], speeds: NDArray[np.float32]) -> None:
        """Positions (T, 3) in metres and speeds (T, 3) in metres a second, in the trackers' order."""
        for places, values in ((self._positions, positions), (self._speeds, speeds)):
            begin = 0
            for place in places:
                place[...] = values[begin : begin + len(place)]
                begin += len(place)

    def _vectors(self, at: int, tracker_bytes: int) -> list[NDArray[np.float32]]:
        """Each packet's vectors that lie `at` bytes behind the beginning of their tracker, (n, 3)."""
        first = _STAMP_AT + _STAMP.size + _CHUNK.size
        return [
            np.ndarray(
                ((len(buffer) - first) // tracker_bytes, 3), "<f4", buffer, first + at, (tracker_bytes, 4)
            )
            for buffer in self._buffers
        ]


class InfoPackets(Packets):
    """PSN_INFO: what the system and its trackers are called."""

    def __init__(self, system_name: str, names: Mapping[int, str]) -> None:
        trackers = [_parent(number, _chunk(_NAME, name.encode())) for number, name in names.items()]
        system = _chunk(_SYSTEM_NAME, system_name.encode())
        super().__init__(_INFO, _split(_INFO_TRACKERS, trackers, before=system))


def _chunk(number: int, data: bytes) -> bytes:
    return _CHUNK.pack(number, len(data)) + data


def _parent(number: int, chunks: bytes) -> bytes:
    return _CHUNK.pack(number, len(chunks) | _PARENT) + chunks


def _split(list_number: int, trackers: Sequence[bytes], before: bytes) -> list[bytes]:
    """The trackers, in order, in as few lists as fit one packet each; `before` precedes each list."""
    room = MAX_PACKET - _STAMP_AT - _STAMP.size - len(before) - _CHUNK.size
    lists = [b""]
    for tracker in trackers:
        if lists[-1] and len(lists[-1]) + len(tracker) > room:
            lists.append(b"")
        lists[-1] += tracker
    return [before + _parent(list_number, trackers) for trackers in lists]
