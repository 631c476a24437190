"""Dialect with messages for each joint, for TouchDesigner, Max and Pure Data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.osc.template import address_part, bundles, message
from appliance.pose.skeleton import Skeleton


class Joint:
    """`/dancer/<joint>/rot ,ffff` (local, w, x, y, z) and `/dancer/<joint>/pos ,fff` (world, metres).

    Puppet 1 and on have their number in it: `/dancer/1/<joint>/rot`.

    Bundles that fit an Ethernet frame. Axes are the box's own: right-handed, Y up.
    """

    def __init__(self, skeleton: Skeleton, puppet: int = 0) -> None:
        messages, dancer = [], f"/dancer/{puppet}" if puppet else "/dancer"
        for name in skeleton.names:
            messages.append(message(f"{dancer}/{address_part(name)}/rot", floats=4))
            messages.append(message(f"{dancer}/{address_part(name)}/pos", floats=3))
        self._template = bundles(messages)
        self._rotations = np.stack(self._template.places[0::2])
        self._positions = np.stack(self._template.places[1::2])

    def encode(self, frame: JointFrame, puppet: PuppetFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        self._template.numbers[self._rotations] = puppet.pose
        self._template.numbers[self._positions] = puppet.positions
        return self._template.datagrams
