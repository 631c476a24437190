"""`/bunraku/frame ,iiiif`: which tick the joints after it belong to; what latency probes follow."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.template import osc_string

_HEAD = osc_string("/bunraku/frame") + osc_string(",iiiif")
_ARGUMENTS = struct.Struct(">iiiif")  # Pure Data and others refuse h and d
_WRAP = 1 << 31


class FrameMessage:
    """tick, whole seconds of the frame time, sequence of the primary sensor (-1: none), late (0 or 1), the
    rest of the frame time (monotonic seconds). Tick and sequence begin anew at 2^31."""

    def __init__(self) -> None:
        self._buffer = bytearray(_HEAD + bytes(_ARGUMENTS.size))
        self._datagrams = (memoryview(self._buffer),)

    def encode(self, frame: JointFrame) -> Sequence[memoryview]:
        """The datagram of this frame; the same buffer each time."""
        second, sequence = int(frame.frame_time), frame.sensor_sequence
        _ARGUMENTS.pack_into(
            *(self._buffer, len(_HEAD), frame.tick % _WRAP, second),
            *(sequence % _WRAP if sequence >= 0 else -1, frame.late, frame.frame_time - second),
        )
        return self._datagrams
