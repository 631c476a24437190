"""The training poses of a pose model, from which its map is made."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from appliance.dancer.material.latent_paths import Latents
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import Dataset
from appliance.studio.improviser.naturalness import figure_shapes
from appliance.studio.pose_space.latent_poses import latents_of

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network


def training_poses(network: Network, dataset: Dataset) -> tuple[Latents, Array]:
    """Latents (N, Z) and figures (N, M * 3) in centimetres of all sound training poses."""
    takes = [(take.recording, take.sound) for take in dataset.training]
    poses = [recording.poses[sound][:, list(dataset.moving)] for recording, sound in takes]
    figures = [figure_shapes(recording, dataset.moving)[sound] for recording, sound in takes]
    return latents_of(network, np.concatenate(poses))[0], np.concatenate(figures)
