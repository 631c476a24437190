"""Playhead: a position in a loop, its place on the stage, and how poses are read there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from appliance.dancer.loop import Loop, Placement
from appliance.dancer.phrase import AT, FPS, X, Z
from appliance.dancer.slerp import FloatArray, Slerp

TURN_HOME = math.radians(30.0) / FPS  # a tick, at most: half a turn in six seconds, in which feet step along
_HOME_S = 1.0  # time constant of the end of that turn
_AT_HOME = math.radians(0.1)


@dataclass
class Playhead:
    """A position in a loop (frames and fractions), its place on the stage, and the pose (J, 4) read last,
    whose signs the next one follows.
    """

    loop: Loop
    position: float
    pose: FloatArray
    placement: Placement = field(default_factory=Placement)

    @property
    def standing(self) -> tuple[float, float, float]:
        """The root on the stage: x, z in metres, heading in radians."""
        index = int(self.position)
        x, z = self.loop.track[index, [X, Z]].tolist()
        w, _, y, _ = self.loop.poses[index, 0].tolist()
        return *self.placement.point(x, z), 2 * math.atan2(y, w) + self.placement.yaw

    def move(self, rate: float) -> None:
        """Advance by `rate` frames, across the loop's seam if it is reached."""
        loop, before = self.loop, self.position
        self.position += rate
        if self.position >= loop.length:
            self.position -= loop.period
            self.placement = self.placement.after(loop.step)
        elif before >= loop.fade > self.position and rate < 0:
            self.position += loop.period
            self.placement = self.placement.after(loop.step.inverse)
        elif self.position < 0:
            self.position = 0.0
        if loop.turns_home and self.placement.yaw:
            self._turn_home()

    def _turn_home(self) -> None:
        """A tick of the turn, about where the root stands, that ends with the loop's own heading."""
        x, z, _ = self.standing
        missing = -math.remainder(self.placement.yaw, math.tau)
        turn = max(-TURN_HOME, min(TURN_HOME, missing / (_HOME_S * FPS)))
        if abs(missing) < _AT_HOME:
            turn = -self.placement.yaw
        self.placement = Placement.bringing((x, z, 0.0), (x, z, turn)).after(self.placement)


class Reader:
    """Reads poses and tracks at the positions of heads into preallocated arrays."""

    def __init__(self, joints: int) -> None:
        self._between_frames = Slerp(joints)
        self._sampled = np.empty((joints, 4), dtype=np.float32)
        self._signs = np.empty((joints, 1), dtype=np.float32)

    def read(self, head: Playhead, track: FloatArray) -> None:
        """Write head.pose (J, 4) and the track (C,) at the head's position, placed on the stage."""
        loop, placement, pose = head.loop, head.placement, self._sampled
        index = int(head.position)
        share = head.position - index
        if share:
            self._between_frames(loop.poses[index], loop.poses[index + 1], share, pose)
            track[:] = loop.track[index] + share * (loop.track[index + 1] - loop.track[index])
        else:
            pose[:] = loop.poses[index]
            track[:] = loop.track[index]
        w, x, y, z = pose[0].tolist()
        cosine, sine = math.cos(placement.yaw / 2), math.sin(placement.yaw / 2)
        pose[0] = cosine * w - sine * y, cosine * x + sine * z, cosine * y + sine * w, cosine * z - sine * x
        track[X], track[Z] = placement.point(float(track[X]), float(track[Z]))
        track[AT] = loop.start_s + head.position / FPS
        np.einsum("jk,jk->j", pose, head.pose, out=self._signs[:, 0])
        np.copysign(1.0, self._signs, out=self._signs)
        np.multiply(pose, self._signs, out=head.pose)
