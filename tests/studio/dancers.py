"""A dancer whose limbs belong together, made of a few slow motions: to try figures of a held dance on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.recording import Recording
from tests.studio.tiny import moving, skeleton

FPS, MOTIONS = 50.0, 4
ARM = "lShldr"  # moves with the first motion alone; so do parts of all others

_style = np.random.default_rng(7)
_AXES = _style.normal(size=(len(moving()), 3))
_SHARES = _style.normal(size=(len(moving()), MOTIONS)) * [1.0, 0.7, 0.7, 0.7]
_SHARES[[skeleton().names[joint] for joint in moving()].index(ARM)] = [1.5, 0, 0, 0]


def motions(seconds: float, seed: int) -> NDArray[np.float64]:
    """(T, MOTIONS): slow, irregular, of deviation 1."""
    rng = np.random.default_rng(seed)
    count = round(seconds * FPS)
    noise = rng.normal(size=(count + 200, MOTIONS))
    width = np.hanning(51)
    slow = np.stack([np.convolve(column, width, "same")[100:-100] for column in noise.T], axis=1)
    made: NDArray[np.float64] = slow / np.sqrt((width**2).sum())
    return made


def danced(moves: NDArray[np.float64]) -> Recording:
    """The dance of motions (T, MOTIONS)."""
    bones = skeleton()
    poses = np.tile(np.array([1.0, 0, 0, 0]), (len(moves), len(bones), 1))
    for row, joint in enumerate(moving()):
        poses[:, joint] = quaternion.from_axis_angle(_AXES[row], 0.3 * np.tanh(moves @ _SHARES[row] / 2) * 2)
    roots = np.stack([0.1 * moves[:, 1], np.full(len(moves), 0.8), 0.1 * moves[:, 2]], axis=-1)
    return Recording(bones, quaternion.continuous(poses), roots, FPS)
