"""`/bunraku/frame ,hdhi`: which tick the joints after it belong to; what latency probes follow."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.template import osc_string

_HEAD = osc_string("/bunraku/frame") + osc_string(",hdhi")
_ARGUMENTS = struct.Struct(">qdqi")


class FrameMessage:
    """tick, frame time (monotonic seconds), sequence of the primary sensor (-1: none), late (0 or 1)."""

    def __init__(self) -> None:
        self._buffer = bytearray(_HEAD + bytes(_ARGUMENTS.size))
        self._datagrams = (memoryview(self._buffer),)

    def encode(self, frame: JointFrame) -> Sequence[memoryview]:
        """The datagram of this frame; the same buffer each time."""
        _ARGUMENTS.pack_into(
            self._buffer, len(_HEAD), frame.tick, frame.frame_time, frame.sensor_sequence, frame.late
        )
        return self._datagrams
