"""PosiStageNet out: chosen joints as trackers for media servers and followspots (posistage.net)."""

from __future__ import annotations

import ipaddress
import struct
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.axes import turn_of
from appliance.outputs.datagram_sender import DatagramPath, DatagramSender
from appliance.outputs.joint_frame import JointFrame
from appliance.pose.skeleton import Skeleton
from appliance.show.posistagenet import PosiStageNetConfig

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

INFO_PERIOD_S = 1.0


class PosiStageNet(DatagramSender):
    """One receiver: data packets for every n-th joint frame, and the names once a second.

    A late frame repeats positions and speeds: the box stopped, not the dancer.
    """

    def __init__(
        self, config: PosiStageNetConfig, skeleton: Skeleton, puppets: Sequence[str] = ("",)
    ) -> None:
        """puppets: their names. Trackers have it before the joint's, but for those of puppet 0."""
        # Only multicast needs its interface named: the kernel knows the route to a single receiver.
        interface = config.interface if ipaddress.IPv4Address(config.host).is_multicast else None
        path = DatagramPath(config.host, config.port, interface)
        super().__init__(f"{config.host}:{config.port} (posistagenet)", path)
        names = tuple(config.joints) or skeleton.names
        self._joints = np.array([skeleton.names.index(name) for name in names])
        names += tuple(f"{puppet} {name}" for puppet in puppets[1:] for name in names)
        numbers = range(config.first_tracker, config.first_tracker + len(names))
        self._data = DataPackets(numbers, config.speed)
        self._info = InfoPackets(config.system_name, dict(zip(numbers, names, strict=True)))
        self._turn = turn_of(config.axes) * np.float32(config.scale)
        self._offset = np.array(config.offset, np.float32)
        self._taken, self._positions, self._before, self._speeds = np.zeros((4, len(names), 3), np.float32)
        self._taken_of = self._taken.reshape(len(puppets), -1, 3)
        self._with_speed = config.speed
        self._every, self._frames = config.every, 0
        self._started: float | None = None
        self._time_before = self._next_info = 0.0

    def send_frame(self, frame: JointFrame) -> None:
        """Send this frame, if it is an n-th one. Never waits, never raises."""
        is_due = self._frames % self._every == 0
        self._frames += 1
        if is_due:
            self.send_datagrams(self.encode(frame), frame.frame_time)

    def encode(self, frame: JointFrame) -> Sequence[memoryview]:
        """Datagrams of this frame, the same buffers each time; once a second the names first."""
        if self._started is None or frame.frame_time < self._started:  # a follower learns its leader's clock
            self._started = self._next_info = self._time_before = frame.frame_time
            self._place(frame, self._before)
        self._place(frame, self._positions)
        if self._with_speed:
            self._note_speeds(frame)
        self._data.fill(self._positions, self._speeds)
        time_us = round(1e6 * (frame.frame_time - self._started))
        if frame.frame_time < self._next_info:
            return self._data.stamped(time_us)
        self._next_info = frame.frame_time + INFO_PERIOD_S
        return (*self._info.stamped(time_us), *self._data.stamped(time_us))

    def _place(self, frame: JointFrame, out: NDArray[np.float32]) -> None:
        """Positions of the trackers, (T, 3), in the receiver's axes and units."""
        for puppet, taken in zip(frame.puppets, self._taken_of, strict=True):
            np.take(puppet.positions, self._joints, axis=0, out=taken)
        np.matmul(self._taken, self._turn, out=out)
        np.add(out, self._offset, out=out)

    def _note_speeds(self, frame: JointFrame) -> None:
        """The trackers' movement since the last frame that was not late, a second."""
        passed_s = frame.frame_time - self._time_before
        if frame.late or passed_s <= 0.0:
            return
        np.subtract(self._positions, self._before, out=self._speeds)
        np.divide(self._speeds, passed_s, out=self._speeds)
        self._before[...] = self._positions
        self._time_before = frame.frame_time


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
