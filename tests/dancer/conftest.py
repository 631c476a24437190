"""A small figure on two legs and phrases of it, made by rule."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.dancer.puppet import Puppet
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

NAMES = ("hip", "chest", "lShldr", "rShldr", "lThigh", "lShin", "lFoot", "rThigh", "rShin", "rFoot")
PARENTS = (-1, 0, 1, 1, 0, 4, 5, 0, 7, 8)
OFFSETS = np.array(
    [
        (0.0, 0.0, 0.0),
        (0.0, 0.4, 0.0),
        (0.2, 0.1, 0.0),
        (-0.2, 0.1, 0.0),
        (0.1, 0.0, 0.0),
        (0.0, -0.4, 0.0),
        (0.0, -0.4, 0.0),
        (-0.1, 0.0, 0.0),
        (0.0, -0.4, 0.0),
        (0.0, -0.4, 0.0),
    ]
)
ENDS = ((2, (0.5, 0.0, 0.0)), (6, (0.0, -0.05, 0.15)), (3, (-0.5, 0.0, 0.0)), (9, (0.0, -0.05, 0.15)))
STANDING_HIP_M = 0.85


@pytest.fixture(scope="session")
def skeleton() -> Skeleton:
    return Skeleton(NAMES, PARENTS, OFFSETS, ENDS)


def _swinging(skeleton: Skeleton, frames: int, hertz: tuple[float, ...], circle_s: float) -> Recording:
    """At 50 Hz on the spot: joints 1 to 3 swing at these frequencies, the hip goes around a small circle."""
    time_s = np.arange(frames) / 50.0
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (frames, len(skeleton), 1))
    for joint, frequency in enumerate(hertz, 1):
        angle = 0.6 * np.sin(2 * np.pi * frequency * time_s)
        poses[:, joint] = quaternion.from_axis_angle([0.3, 0.2, 1.0], angle)
    turn = 2 * np.pi * time_s / circle_s
    roots = np.stack([0.2 * np.cos(turn), np.full(frames, STANDING_HIP_M), 0.2 * np.sin(turn)], axis=1)
    return Recording(skeleton, poses, roots, 50.0)


@pytest.fixture(scope="session")
def swaying(skeleton: Skeleton) -> Recording:
    """Four seconds that are a closed loop."""
    return _swinging(skeleton, 200, (0.25, 0.5, 0.75), 4.0)


@pytest.fixture(scope="session")
def open_ended(skeleton: Skeleton) -> Recording:
    """4.4 seconds that end in another pose than they start with, some centimetres away."""
    return _swinging(skeleton, 220, (0.27, 0.55, 0.83), 4.1)


@pytest.fixture(scope="session")
def walking(skeleton: Skeleton) -> Recording:
    """Four seconds straight ahead along +x at 1 m/s, turning left by a quarter of a turn."""
    time_s = np.arange(200) / 50.0
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (200, len(skeleton), 1))
    poses[:, 0] = quaternion.from_axis_angle([0.0, 1.0, 0.0], time_s / 4.0 * np.pi / 2)
    poses[:, 4] = quaternion.from_axis_angle([1.0, 0.0, 0.0], 0.5 * np.sin(2 * np.pi * time_s))
    poses[:, 7] = quaternion.from_axis_angle([1.0, 0.0, 0.0], -0.5 * np.sin(2 * np.pi * time_s))
    roots = np.stack([time_s, np.full(200, STANDING_HIP_M), np.zeros(200)], axis=1)
    return Recording(skeleton, poses, roots, 50.0)


def random_quaternions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Unit quaternions, uniform over all rotations and signs."""
    q = rng.normal(size=(*shape, 4))
    return (q / np.linalg.norm(q, axis=-1, keepdims=True)).astype(np.float32)


def dance(
    puppet: Puppet,
    window: np.ndarray,
    mask: np.ndarray,
    targets: np.ndarray,
    weights: np.ndarray,
    *times: int,
) -> np.ndarray:
    """What the puppet makes of a window (T, M, 4): its poses (T, M, 4). All others dance as well."""
    puppet.window[:] = window
    puppet.hold(mask, targets, weights, *times)
    puppet.network.dance()
    return puppet.poses.copy()
