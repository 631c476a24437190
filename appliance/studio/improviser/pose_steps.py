"""A dance pose by pose, as 'Beyond Imitation' feeds its LSTM: 20 ms a step; and back to motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from appliance.dancer.loop import turns_about_y
from appliance.dancer.material.steps import Steps, path_along, ways_of
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import Take
from appliance.studio.improviser.steps import sound_stretches


def pose_steps(recording: Recording, moving: Sequence[int], rest: Array) -> Steps:
    """Steps of a recording at 50 Hz, the first frame left out: it only says where the second comes from.

    A step's latent (M * 4,) is its pose: the moving joints' quaternions, heading removed, in the hemisphere
    of rest (M, 4).
    """
    poses = recording.poses[1:, list(moving)].copy()
    poses[:, 0] = quaternion.multiply(quaternion.inverse(quaternion.heading(poses[:, 0])), poses[:, 0])
    flat = quaternion.aligned(poses, rest).reshape(len(poses), 4 * len(moving))
    return Steps(flat.astype(np.float32), ways_of(recording, np.arange(len(recording))))


def pose_stretches(takes: Sequence[Take], moving: Sequence[int], rest: Array, shortest: int) -> list[Tensor]:
    """Features (T, M * 4 + 4) of each sound stretch of at least `shortest` steps, and of its mirror image."""
    long = (one for one in sound_stretches(takes, moving) if len(one) > shortest)
    return [torch.tensor(pose_steps(one, moving, rest).features) for one in long]


def pose_motion(steps: Steps, still_pose: Array, moving: Sequence[int]) -> tuple[Array, Array]:
    """Poses (T - 1, J, 4) and roots (T - 1, 3) at 50 Hz of T steps, from the first one's place on.

    still_pose (J, 4): how the other joints stand.
    """
    heading = np.cumsum(steps.ways[:, 2].astype(np.float64))
    made = quaternion.normalize(steps.latents.astype(np.float64).reshape(len(steps), len(moving), 4))
    made[:, 0] = quaternion.multiply(turns_about_y(heading), made[:, 0])
    poses = np.tile(still_pose, (len(steps) - 1, 1, 1))
    poses[:, list(moving)] = made[:-1]
    return quaternion.continuous(poses), path_along(steps.ways, heading, 1)
