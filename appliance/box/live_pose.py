"""The live pose: the newest pose of a live dancer's motion capture, from show control to the stage."""

from __future__ import annotations

import math
import struct
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from appliance.box.block import BlockReader, BlockWriter

FILE, KIND = "live_pose", "live_pose"
MOST_JOINTS = 128
_HEAD = struct.Struct("<dI3f")  # arrival, joints, root


class LivePose(NamedTuple):
    """arrival: monotonic seconds; root: x, y, z in metres, not a number where none is sent; rotations: local
    quaternions of all joints in the skeleton's order, w, x, y, z after each other, as float32.
    """

    arrival: float
    root: tuple[float, float, float]
    rotations: bytes

    @property
    def joints(self) -> int:
        """How many joints."""
        return len(self.rotations) // 16


class LivePoseWriter:
    """Show control's end. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, _HEAD.size + 16 * MOST_JOINTS, fresh=True)

    def write(self, arrival: float, root: Sequence[float], rotations: Sequence[float]) -> None:
        """Publish; at most MOST_JOINTS joints."""
        head = _HEAD.pack(arrival, len(rotations) // 4, *root)
        self._block.write(head + array("f", rotations).tobytes())

    def close(self) -> None:
        self._block.close()


class LivePoseReader:
    """The stage's end."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockReader(folder / FILE, KIND, writer="show control")
        self._newest = -math.inf

    def read(self) -> LivePose | None:
        """A pose that came since the last call, or None. Never waits, never raises."""
        payload = self._block.read()
        if payload is None or len(payload) < _HEAD.size:
            return None
        arrival, joints, *root = _HEAD.unpack_from(payload)
        rotations = payload[_HEAD.size :]
        if arrival == self._newest or len(rotations) != 16 * joints:
            return None
        self._newest = arrival
        return LivePose(arrival, (root[0], root[1], root[2]), rotations)

    def close(self) -> None:
        self._block.close()


def forget_live_pose(folder: Path) -> None:
    """A show that ended as it should leaves no guest."""
    (folder / FILE).unlink(missing_ok=True)
