"""Pointing: the place on the map of poses at which the limb points that a hand holds."""

from __future__ import annotations

import math

import numpy as np

from appliance.outputs.joint_frame import PuppetFrame
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton

HELD = 0.5  # a hand with less weight is ignored
STEADY = 0.03  # fraction of the map: a limb that trembles by less stays where it pointed


class Pointing:
    """Reads the frames of a puppet. joint: the name of the one that the hand holds."""

    def __init__(self, skeleton: Skeleton, joint: str) -> None:
        self._joint = skeleton.index(joint)
        below = [child for child, parent in enumerate(skeleton.parents) if parent == self._joint]
        limb = np.asarray(skeleton.offsets[below[0]] if below else (0.0, 0.0, 1.0), np.float32)
        self._limb = limb / max(float(np.linalg.norm(limb)), 1e-6)
        self._point: list[float] = []

    def point(self, frame: PuppetFrame | None) -> list[float]:
        """x, y, each 0 to 1, as `/motion/path` takes them; [] while the hand does not hold.

        Depends only on the joint's rotation, seen from the front of the parent joint: ahead is the middle;
        left and right, up and down are the edges. Angles would leap where a limb hangs.
        """
        if frame is None or frame.holds[self._joint] < HELD:
            self._point = []
            return self._point
        x, y, _ = quaternion.rotate(frame.pose[self._joint], self._limb).tolist()
        found = [round(min(max(0.5 + share / 2, 0.0), 1.0), 2) for share in (x, y)]
        if not self._point or math.dist(found, self._point) > STEADY:
            self._point = found
        return self._point
