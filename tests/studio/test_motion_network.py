"""Pose and sequence models as files of a show: they compute what was trained, and carry a map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.material.motion_network import MotionNetwork, map_facts
from appliance.pose import quaternion
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.export.motion_network import write_motion_network
from appliance.studio.granular.granular import encoded
from appliance.studio.studio_error import StudioError
from tests.studio.tiny import moving, skeleton, swaying

NAMES = [skeleton().names[joint] for joint in moving()]


def untrained(network: str, window: int) -> Autoencoder:
    torch.manual_seed(1)
    made, shape = build(network, window, len(NAMES), variational=True, latent=8, width=48, depth=1)
    rest = torch.tensor(quaternion.IDENTITY).repeat(len(NAMES), 1)
    made.start_at(rest.flatten())
    return Autoencoder(made, shape, rest).eval()


@pytest.mark.parametrize("window", [1, 32])
def test_the_file_encodes_and_decodes_as_it_was_trained(tmp_path: Path, window: int) -> None:
    autoencoder = untrained("mlp", window)
    ground = map_facts(np.zeros(8), np.eye(2, 8), np.full(2, -1), np.ones(2))
    write_motion_network(autoencoder, NAMES, tmp_path / "model.onnx", ground if window == 1 else "")
    network = MotionNetwork(tmp_path / "model.onnx", skeleton().names)
    assert (network.window, network.latent, list(network.joints)) == (window, 8, NAMES)
    assert (network.ground is not None) == (window == 1)
    poses = swaying(3.0).poses[:, list(moving())].astype(np.float32)
    windows = np.stack([poses[at : at + window] for at in range(0, 100, 20)])
    latents, facing = encoded(autoencoder, windows)
    found, found_facing = network.encode(windows)
    assert np.abs(found - latents).max() < 0.02  # weights in 16 bits
    assert np.abs(quaternion.aligned(found_facing, facing) - facing).max() < 1e-5
    with torch.no_grad():
        raw = autoencoder.decode_raw(torch.from_numpy(latents)).numpy()
    assert np.abs(network.decode(latents) - raw).max() < 0.02


def test_a_network_that_the_box_does_not_take_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudioError, match="mlp alone"):
        write_motion_network(untrained("lstm", 32), NAMES, tmp_path / "model.onnx")
