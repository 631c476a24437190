"""Reach: where a joint goes in this dancer's dances, as the show's own phrases tell."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from appliance.dancer.slerp import FloatArray
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

WIDTH = 3.0  # in standard deviations
LEAST_M = 0.08  # added to the deviation in all directions: a phrase does not show all that its dancer does
_EVERY = 5  # poses of a phrase


class Reach(NamedTuple):
    """An ellipsoid around the mean place of a joint: middle (3,) and axes (3, 3), metres, figure's frame.

    Outside of it the network has learned nothing. Measured with a fixed place from which a salsa dancer goes
    away, with a prototype of such a network at 10/9: bounded only by the length of the bones, the wrist was
    19 cm off its target and went up to 16 m/s; within 3 deviations 2 cm and 2.3 m/s.
    """

    middle: FloatArray
    axes: FloatArray

    def bounded(self, place: FloatArray) -> FloatArray:
        """A place (3,), brought in straight towards the middle where it is outside."""
        way = place - self.middle
        far = float(np.linalg.norm(np.linalg.solve(self.axes, way)))
        return self.middle + way / np.float32(max(1.0, far))


def reach_in(phrases: Iterable[Array], skeleton: Skeleton, joint: int) -> Reach:
    """Where a joint goes in phrases, each (N, J, 4)."""
    poses = np.concatenate([phrase[::_EVERY] for phrase in phrases]).astype(np.float64)
    facing = quaternion.heading(poses[:, :1])
    root = quaternion.multiply(quaternion.inverse(facing), poses[:, :1])
    level = np.concatenate([root, poses[:, 1:]], axis=1)
    places = skeleton.forward_kinematics(level, np.zeros(3))[0][:, joint]
    apart = places - places.mean(axis=0)
    spread = apart.T @ apart / len(apart) + LEAST_M**2 * np.eye(3)
    axes = WIDTH * np.linalg.cholesky(spread)
    return Reach(places.mean(axis=0).astype(np.float32), axes.astype(np.float32))
