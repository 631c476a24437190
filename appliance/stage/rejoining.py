"""A box that comes back into step: its figures are led from its own dance to the leader's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from appliance.box.clock import TICK_S
from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.slerp import FloatArray, Slerp
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.skeleton import Skeleton


class Rejoining:
    """Leads what receivers get; the dance behind it is the leader's at once.

    As a worn sensor that comes back: the difference of each joint, and of the root, is fixed when the first
    frame of the leader comes, and removed over the fade while its dance goes on. Then frames are the leader's
    bit for bit.
    """

    def __init__(self, skeleton: Skeleton, puppets: Sequence[PuppetFrame], fade_s: float) -> None:
        self._step = TICK_S / max(fade_s, TICK_S)
        self._share = 1.0  # how much of the way has been gone
        self._is_new = False  # the difference is not known yet
        self._shown = JointFrame(tuple(PuppetFrame.of(len(skeleton)) for _ in puppets))
        self._figure, self._slerp = Figure(skeleton), Slerp(len(skeleton))
        self._apart = np.tile(quaternion.IDENTITY, (len(puppets), len(skeleton), 1))
        self._away = np.zeros((len(puppets), 3), np.float32)  # the root's difference, metres

    def begin(self, frame: JointFrame) -> None:
        """The state that this frame came from is about to become the leader's. One that never left: nothing
        is led.
        """
        if frame.frame_time:
            if self._share == 1.0:
                for shown, puppet in zip(self._shown.puppets, frame.puppets, strict=True):
                    shown.pose[:], shown.root[:] = puppet.pose, puppet.root
            self._share, self._is_new = 0.0, True

    def lead(self, frame: JointFrame) -> JointFrame:
        """The frame for receivers, valid until the next call."""
        if self._share == 1.0:
            return frame
        if self._is_new:
            self._is_new = False
            for place, (shown, puppet) in enumerate(zip(self._shown.puppets, frame.puppets, strict=True)):
                self._apart[place] = quaternion.multiply(shown.pose, quaternion.inverse(puppet.pose))
                self._away[place] = shown.root - puppet.root
        elif not frame.late:
            self._share = min(1.0, self._share + self._step)
        left = 1.0 - ease(self._share)
        for place, (shown, puppet) in enumerate(zip(self._shown.puppets, frame.puppets, strict=True)):
            self._lead(shown, puppet, self._apart[place], left * self._away[place], left)
        return replace(frame, puppets=self._shown.puppets)

    def _lead(
        self, shown: PuppetFrame, puppet: PuppetFrame, apart: FloatArray, away: FloatArray, left: float
    ) -> None:
        for name in ("source", "holds"):
            getattr(shown, name)[:] = getattr(puppet, name)
        self._slerp(np.broadcast_to(quaternion.IDENTITY, apart.shape), apart, left, out=shown.pose)
        shown.pose[:] = quaternion.normalize(quaternion.multiply(shown.pose, puppet.pose))
        np.add(puppet.root, away, out=shown.root)
        self._figure.set_pose(shown.pose, shown.root)
        shown.world[:], shown.positions[:] = self._figure.world, self._figure.positions
