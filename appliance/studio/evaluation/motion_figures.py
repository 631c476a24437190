"""How a dance moves: angles between poses, energy, roughness, the largest step."""

from __future__ import annotations

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array

ROUGHNESS_PERCENTILE = 99.0


def degrees_apart(a: Array, b: Array) -> Array:
    """(T,): mean joint angle between poses (T, M, 4)."""
    apart: Array = np.degrees(quaternion.angle_between(a, b)).mean(axis=-1)
    return apart


def energy(poses: Array) -> float:
    """Mean joint speed of poses (T, M, 4), degrees a tick."""
    return float(_steps(poses).mean())


def largest_step(poses: Array) -> float:
    """The furthest that any joint goes from one tick to the next, degrees."""
    return float(_steps(poses).max())


def roughness(poses: Array) -> float:
    """99th percentile of the angular acceleration over ticks and joints, degrees a tick squared.

    A joint's angular velocity is the axis of its step times the angle, in the parent's frame.
    """
    turns = quaternion.multiply(poses[1:], quaternion.inverse(poses[:-1]))
    axes, angles = quaternion.to_axis_angle(turns)
    velocities = axes * np.degrees(angles)[..., None]
    accelerations = np.linalg.norm(np.diff(velocities, axis=0), axis=-1)
    return float(np.percentile(accelerations, ROUGHNESS_PERCENTILE))


def _steps(poses: Array) -> Array:
    """(T - 1, M): degrees that each joint goes from tick to tick."""
    steps: Array = np.degrees(quaternion.angle_between(poses[1:], poses[:-1]))
    return steps
