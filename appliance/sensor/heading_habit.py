"""Habit of a joint: where it points at each tilt, seen from the dancer's front, as the show's phrases tell.

An arm that hangs, is raised or is stretched out points in some directions more often than in others. This is
the knowledge that turns minutes of dancing into a measurement of the heading (heading_drift.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

CELLS = 64  # tilts, evenly over the sphere: 29 degrees from one to the next
_SHARPNESS = 12.0  # a cell's bell (von Mises and Fisher) is 17 degrees wide
_FEW = 5.0  # poses; a cell that saw fewer is believed less
_EVERY_S = 0.2


class HeadingHabit:
    """directions (CELLS,): mean of exp(i heading) in each cell; its length is how certain the heading is."""

    def __init__(self, directions: NDArray[np.complex128]) -> None:
        self._cells = _cells()
        self._directions = [complex(direction) for direction in directions]

    def expected(self, up: Sequence[float]) -> complex:
        """Mean direction for a tilt: `up` (3,) is the vertical as seen from the joint, unit."""
        return self._directions[int(np.argmax(self._cells @ np.array(up)))]


def habit_in(
    phrases: Iterable[tuple[Array, float]], skeleton: Skeleton, joint: int, at_neutral: Sequence[float]
) -> HeadingHabit:
    """The habit of a joint in phrases: local poses (N, J, 4) and their rate in hertz, in the stage's frame.

    The body's own turns are left out: headings count from where the root faces. at_neutral: the joint's
    orientation in the neutral pose (w, x, y, z), in which its heading is 0.
    """
    sums, weights = np.zeros(CELLS, np.complex128), np.full(CELLS, _FEW)
    for poses, fps in phrases:
        chosen: Array = np.asarray(poses[:: max(1, round(_EVERY_S * fps))], np.float64)
        world: Array = chosen[:, 0]
        facing = quaternion.inverse(quaternion.heading(world))
        for link in reversed(skeleton.ancestors(joint)[:-1]):
            world = quaternion.multiply(world, chosen[:, link])
        world = quaternion.multiply(facing, world)
        moved = quaternion.multiply(world, quaternion.inverse(np.asarray(at_neutral, np.float64)))
        headings = 2.0 * np.arctan2(moved[:, 2], moved[:, 0])
        near = np.exp(_SHARPNESS * (_ups(world) @ _cells().T - 1.0))
        sums += np.exp(1j * headings) @ near
        weights += near.sum(axis=0)
    return HeadingHabit(sums / weights)


def up_of(orientation: Sequence[float]) -> tuple[float, float, float]:
    """The vertical (+y) as seen from a rotation (w, x, y, z), unit."""
    w, x, y, z = orientation
    return 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)


def _ups(rotations: Array) -> Array:
    return np.stack(up_of(np.moveaxis(rotations, -1, 0)), axis=-1)  # type: ignore[arg-type]


def _cells() -> Array:
    """(CELLS, 3) unit vectors, on a spiral from pole to pole."""
    places = np.arange(CELLS) + 0.5
    polar, turn = np.arccos(1.0 - 2.0 * places / CELLS), math.pi * (1.0 + math.sqrt(5.0)) * places
    return np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=-1)
