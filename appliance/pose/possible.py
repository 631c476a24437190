"""Possible motion: bounds on places and speeds for numbers from outside, and the root's path within them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array

FARTHEST_M = 1000.0  # a coordinate of a root in a file or a stream
FARTHEST_ON_STAGE_M = 1e5  # position of a figure: a phrase that walks on and on gets 16 km in three hours
FASTEST_M_S = 20.0  # a root; sprinters reach 12, a tracker that loses its dancer hundreds
SHORTEST_S = 0.02  # steps of quicker recordings count as made in one tick: the noise of capture is in them


def impossible_frames(roots: Array, fps: float) -> NDArray[np.intp]:
    """Frames whose root (N, 3), in metres, nobody reaches from the frame before; 0: an impossible start."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.linalg.norm(np.diff(roots, axis=0), axis=1)
    reached = np.concatenate([np.abs(roots[:1]).max(axis=1) <= FARTHEST_M, steps <= most_step_m(1.0 / fps)])
    return np.flatnonzero(~reached)  # also where a step is not a number


def possible_roots(roots: Array, fps: float) -> Array:
    """The path (N, 3) without its impossible steps: it goes on from the last good place."""
    impossible = impossible_frames(roots, fps)
    if not len(impossible):
        return roots
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(roots, axis=0, prepend=np.zeros((1, 3), roots.dtype))
    steps[impossible] = 0.0
    path: Array = np.cumsum(steps, axis=0)
    return path


def most_step_m(elapsed_s: float) -> float:
    """How far a root gets in this time."""
    return FASTEST_M_S * max(elapsed_s, SHORTEST_S)
