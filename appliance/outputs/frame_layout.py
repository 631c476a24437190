"""Layout of the shared frame in its file; without numpy, for processes that do not load it."""

from __future__ import annotations

import struct

FILE, KIND, FORMAT, WRITER = "frame", "frame", 5, "the stage (bunraku play)"
FACTS, HEALTH, FRAMES = range(3)  # the file's rings
FRAME_SLOTS = 64  # a reader has 1.28 s to copy the newest frame
HEALTH_SLOTS, HEALTH_BYTES = 2, 1 << 16
LATE = 1  # flag
GHOST = 2  # flag, only for browsers
# Tick, frame time, when it left the stage, the sensor's sequence and its arrival, flags, joints.
FRAME_HEAD = struct.Struct("<qddqdII")
# For browsers: tick, flags, joints; then each puppet's world rotations (w, x, y, z), positions and holds,
# float32; with GHOST then the local rotations of what the puppet starts from that cues lead.
BROWSER_HEAD = struct.Struct("<dII")


class FrameLayout:
    """Offsets of the arrays of J joints in a frame's payload: all float32, little-endian, in this order.
    Those of the next puppet follow, `stride` bytes after those of the one before; then the hands'
    orientations and a live dancer's positions.
    """

    def __init__(self, joints: int, puppets: int = 1, hands: int = 0, live: int = 0) -> None:
        """hands: of all puppets; live: joints of a live dancer, 0 in a show that takes none."""
        self.joints, self.puppets, self.hands, self.live = joints, puppets, hands, live
        self.root_at = FRAME_HEAD.size
        self.pose_at = self.root_at + 12
        self.source_at = self.pose_at + 16 * joints
        self.world_at = self.source_at + 16 * joints
        self.positions_at = self.world_at + 16 * joints
        self.holds_at = self.positions_at + 12 * joints
        self.stride = self.holds_at + 4 * joints - self.root_at
        self.hands_at = self.root_at + puppets * self.stride
        self.live_at = self.hands_at + 16 * hands
        self.bytes = self.live_at + 12 * live
