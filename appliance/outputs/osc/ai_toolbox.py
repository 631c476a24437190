"""Dialect of the AI-Toolbox family: one flat list of floats a message, quaternions w, x, y, z."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.template import message, single
from appliance.pose.skeleton import Skeleton


class AiToolbox:
    """rot_local and rot_world (J x w, x, y, z) and pos_world (J x x, y, z in metres), a datagram each.

    Axes are the box's own: right-handed, Y up. A list cannot be split: above 86 joints a rotation
    message outgrows an Ethernet frame and travels in IP fragments.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        joints = len(skeleton)
        self._template = single(
            [
                message("/mocap/0/joint/rot_local", floats=4 * joints),
                message("/mocap/0/joint/pos_world", floats=3 * joints),
                message("/mocap/0/joint/rot_world", floats=4 * joints),
            ]
        )
        numbers, places = self._template.numbers, self._template.places
        self._rot_local, self._pos_world, self._rot_world = (
            numbers[place[0] : place[-1] + 1].reshape(joints, -1) for place in places
        )

    def encode(self, frame: JointFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        self._rot_local[...] = frame.pose
        self._pos_world[...] = frame.positions
        self._rot_world[...] = frame.world
        return self._template.datagrams
