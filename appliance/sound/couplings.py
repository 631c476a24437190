"""Couplings for the strings: how alike the figures move, and how far limbs follow the hand, by joint."""

from __future__ import annotations

from collections import deque
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.coupling import ROW_S, ROWS, Floats, coupled, led_by, rows_between
from appliance.outputs.joint_frame import JointFrame
from appliance.pose.anatomy import Anatomy
from appliance.pose.skeleton import Skeleton

TOGETHER_ROW_S = 2 * ROW_S  # trails of 2.35 s tell a couple from strangers better
_SEEN = 128  # frames: more than a trail reaches back
_EVERY = 5  # frames from one measurement to the next: 0.1 s


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
        if self._looks % _EVERY or frame.frame_time - self._seen[0].frame_time < ROWS * TOGETHER_ROW_S:
            return
        times = np.array([one.frame_time for one in self._seen])
        shares, together = [np.zeros_like(self.shares)], []
        for number, puppet in enumerate(frame.puppets):
            positions = np.stack([one.puppets[number].positions for one in self._seen]) / self._height
            leader, led = led_by(_trail(positions, times, ROW_S), puppet.holds)
            if leader is not None:
                led[leader] = 0.0  # it follows the hand by itself
            shares.append(led)
            together.append(_trail(positions, times, TOGETHER_ROW_S))
        shares += [coupled(one, two, TOGETHER_ROW_S) for one, two in combinations(together, 2)]
        self.shares = np.max(shares, axis=0)


def _trail(positions: Floats, times: NDArray[np.float64], row_s: float) -> Floats:
    """Positions (N, J, 3) at times (N,), as rows (ROWS, J, 3), the newest first."""
    after, part = rows_between(times, float(times[-1]), row_s)
    before = positions[after - 1]
    between: Floats = before + part[:, None, None].astype(np.float32) * (positions[after] - before)
    return between
