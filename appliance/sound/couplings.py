"""Couplings for the strings: how alike the figures move, and how far limbs follow the hand, by joint."""

from __future__ import annotations

from collections import deque
from itertools import combinations

import numpy as np

from appliance.outputs.coupling import ROW_S, ROWS, Floats, coupled, led_by, rows_between
from appliance.outputs.joint_frame import JointFrame
from appliance.pose.anatomy import Anatomy
from appliance.pose.skeleton import Skeleton

_SEEN = 64  # frames: more than a trail reaches back
_EVERY = 5  # frames from one measurement to the next: 0.1 s of a trail of more than a second


class Couplings:
    """shares (J,): of each joint the closest of its couplings now, 0..1, as the look `strings` draws them."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._height = Anatomy(skeleton).height
        self.shares: Floats = np.zeros(len(skeleton), np.float32)
        self._seen: deque[JointFrame] = deque(maxlen=_SEEN)
        self._looks = 0

    def look(self, frame: JointFrame) -> None:
        """The newest frame, which comes once."""
        self._seen.append(frame)
        self._looks += 1
        if self._looks % _EVERY or frame.frame_time - self._seen[0].frame_time < ROWS * ROW_S:
            return
        after, part = rows_between(np.array([one.frame_time for one in self._seen]), frame.frame_time)
        trails, shares = [], [np.zeros_like(self.shares)]
        for number, puppet in enumerate(frame.puppets):
            positions = np.stack([one.puppets[number].positions for one in self._seen]) / self._height
            before = positions[after - 1]
            trails.append(before + part[:, None, None] * (positions[after] - before))
            leader, led = led_by(trails[-1], puppet.holds)
            if leader is not None:
                led[leader] = 0.0  # it follows the hand by itself
            shares.append(led)
        shares += [coupled(one, two) for one, two in combinations(trails, 2)]
        self.shares = np.max(shares, axis=0)
