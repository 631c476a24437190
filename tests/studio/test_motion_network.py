"""Pose and sequence models as files of a show: they compute what was trained, and carry a map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import improvised
from appliance.dancer.material.motion_network import MotionNetwork, MotionNetworkError, map_facts
from appliance.pose import quaternion
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.coded_windows import encoded
from appliance.studio.export import improviser_network as export
from appliance.studio.export.improviser_network import export_improviser
from appliance.studio.export.motion_network import write_motion_network
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.moves import MovesShape
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
    with pytest.raises(StudioError, match="only networks of the kind mlp"):
        write_motion_network(untrained("lstm", 32), NAMES, tmp_path / "model.onnx")


@pytest.mark.parametrize("layers", [1, 2])
def test_an_improvisers_file_goes_on_as_it_was_trained(tmp_path: Path, layers: int) -> None:
    autoencoder = untrained("mlp", 8)
    improviser = Improviser(MovesShape(8, 6, 4, 4, 24), 12, layers, 2).requires_grad_(False)
    improviser.scale.learn(torch.randn(200, 12, generator=torch.Generator().manual_seed(1)))
    path = export_improviser(improviser, autoencoder, NAMES, tmp_path)
    network = ImproviserNetwork(path, skeleton().names)
    heard = torch.randn(2, 19, 12, generator=torch.Generator().manual_seed(2))
    for temperature in (0.0, 1.0):
        trained = improviser.improvise(heard, 3, temperature, 7).numpy()
        assert np.abs(improvised(network, heard.numpy(), 3, temperature, 7) - trained).max() < 0.02
    with pytest.raises(MotionNetworkError, match="kind 'motion'"):
        MotionNetwork(path, skeleton().names)


def test_an_improviser_that_was_not_exported_as_trained_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    improviser = Improviser(MovesShape(8, 6, 4, 4, 24), 12, 1, 2).requires_grad_(False)
    improviser.scale.learn(torch.randn(200, 12))
    monkeypatch.setattr(export, "FARTHEST", 0.01)  # a fault of the graph: its moves hardly move
    with pytest.raises(StudioError, match="differs from the trained one"):
        export_improviser(improviser, untrained("mlp", 8), NAMES, tmp_path)
    assert not (tmp_path / "improviser.onnx").exists()
