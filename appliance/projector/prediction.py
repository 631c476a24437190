"""Prediction: a figure a few hundredths of a second after its newest frame, so that the wall does not lag."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.projector.moment import Floats

SPAN = 2  # ticks over which velocities are measured
CONFIDENCE = 0.8  # share of a velocity that is carried on; 1 is nearer and rougher
REST = 0.5  # share of the time for joints that no hand leads: their lag is not seen, sliding is
MOST_RADIANS = math.radians(30.0)  # that a joint is turned on
MOST_M = 0.1  # that the root is moved on
_HARDLY_ANYTHING = 1e-9


class Figure(NamedTuple):
    """positions (J, 3) metres, world rotations (J, 4) w, x, y, z, holds (J,) 0..1; float32."""

    positions: Floats
    world: Floats
    holds: Floats


class Prediction:
    """Carries a figure on with CONFIDENCE of the velocity of its last SPAN ticks; limbs keep their lengths.

    Held joints, and those below them, are carried on for the whole time, all others for REST of it. The
    limiter is one for the whole figure, van Albada's (see dancer/extrapolation.py): 0 after a jump or where
    the figure turns back, 1 where it moves evenly. With a limiter for each joint a standing foot, which rests
    because hip, knee and ankle move against one another, would slide twice as fast (docs/notebook.md has the
    figures).
    """

    def __init__(self, skeleton: Skeleton) -> None:
        joints = len(skeleton)
        self._above = np.maximum(skeleton.parents, 0)
        self._bones = np.asarray(skeleton.offsets, np.float32).copy()
        self._bones[0] = 0.0
        self._chains = np.zeros((joints, joints), np.float32)  # row j: the joints from the root to j
        for joint in range(joints):
            self._chains[joint, list(skeleton.ancestors(joint))] = 1.0

    def __call__(self, now: Figure, before: Figure, earlier: Figure, ticks: float) -> Figure:
        """The figure `ticks` after now. before, earlier: SPAN and 2 * SPAN ticks before now."""
        last, first = now.positions - before.positions, before.positions - earlier.positions
        along, squares = float(np.vdot(last, first)), float(np.vdot(last, last) + np.vdot(first, first))
        share = CONFIDENCE * max(0.0, 2.0 * along / (squares + _HARDLY_ANYTHING)) * ticks / SPAN
        signs = np.copysign(np.float32(1.0), np.sum(now.world * before.world, axis=-1, keepdims=True))
        turn = now.world - signs * before.world
        farthest = float(np.sqrt(np.max(np.sum(turn * turn, axis=-1))))
        share = min(share, math.tan(MOST_RADIANS / 2.0) / (farthest + _HARDLY_ANYTHING))
        share = min(share, MOST_M / (math.hypot(*last[0].tolist()) + _HARDLY_ANYTHING))
        led = np.max(self._chains * now.holds, axis=1, keepdims=True)
        part = np.float32(share) * (REST + (1.0 - REST) * led)
        world = now.world + part * turn
        world /= np.sqrt(np.sum(world * world, axis=-1, keepdims=True))
        bones = quaternion.rotate(world[self._above], self._bones)
        root = now.positions[0] + part[0] * last[0]
        return Figure((root + self._chains @ bones).astype(np.float32), world, now.holds)
