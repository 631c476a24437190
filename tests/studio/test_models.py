"""What bunraku train trains: each model with its networks, the papers' published forms among them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from appliance.studio.autoencoder.losses import divergence
from appliance.studio.autoencoder.models import MODELS, settings_for
from appliance.studio.autoencoder.training import Training, load_autoencoder
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.studio_error import StudioError
from tests.studio.conftest import bunraku


@pytest.fixture(scope="module")
def dancer(recordings: Path) -> Dataset:
    return load_dataset(recordings)


@pytest.mark.parametrize(
    ("model", "network"),
    [(name, network) for name in ("pose", "sequence") for network in MODELS[name].networks],
)
def test_every_network_of_a_model_learns_and_comes_back_from_its_checkpoint(
    dancer: Dataset, tmp_path: Path, model: str, network: str
) -> None:
    settings = settings_for(model, network, window=0 if model == "pose" else 32, latent=8, width=48)
    training = Training(dancer, replace(settings, steps=60, batch=32, learning_rate=3e-3))
    training.held_windows = training.train_windows
    before = training.held_out_degrees()
    training.run(lambda report: None, lambda: training.save_checkpoint(tmp_path / "checkpoint.pt"))
    after = training.held_out_degrees()
    assert before is not None and after is not None and after < before
    autoencoder, joints, state = load_autoencoder(tmp_path / "checkpoint.pt")
    assert state["settings"]["model"] == model and joints == list(dancer.moving_names)
    assert autoencoder.shape.window == (1 if model == "pose" else 32)
    windows = training.train_windows[:5]
    torch.testing.assert_close(
        autoencoder.iterate(windows, 1)[0], training.averaged.iterate(windows, 1)[0], atol=2e-5, rtol=0
    )


def test_the_published_forms_have_the_published_sizes() -> None:
    pose, sequence = settings_for("pose", "dense64"), settings_for("sequence", "lstm384")
    assert (pose.window, pose.batch, pose.learning_rate) == (1, 128, 1e-4)
    assert sequence.window == 128 and sequence.variational and sequence.weights.divergence == 1e-4
    for settings in (pose, sequence):
        assert settings.weights.squared == 1.0 and settings.weights.rotation == settings.weights.prior == 0.0
    assert settings_for("pose", "dense64", batch=16).batch == 16


def test_a_variational_model_is_drawn_to_the_prior_by_the_weight_of_its_divergence(dancer: Dataset) -> None:
    nats = []
    for weight in (0.0, 1.0):
        settings = settings_for("sequence", window=16, latent=8, width=32)
        weights = replace(settings.weights, divergence=weight)
        training = Training(dancer, replace(settings, steps=60, batch=32, weights=weights))
        training.run(lambda report: None, lambda: None)
        with torch.no_grad():
            nats.append(float(divergence(*training.averaged.encode_gaussian(training.train_windows))))
    assert nats[1] < 0.5 * nats[0]


@pytest.mark.parametrize(
    ("model", "network", "window", "message"),
    [
        ("pose", "lstm", 0, "has the networks mlp, dense64, not lstm"),
        ("pose", None, 8, "takes one pose"),
        ("sequence", None, 8, "takes 16 to 128 poses"),
        ("puppet", "dense64", 0, "has the networks coupled"),
    ],
)
def test_what_does_not_fit_a_model_is_refused(
    model: str, network: str | None, window: int, message: str
) -> None:
    with pytest.raises(StudioError, match=message):
        settings_for(model, network, window=window)


def test_a_pose_model_is_no_show_and_says_what_it_is_for(recordings: Path, tmp_path: Path) -> None:
    options = ["--steps", 5, "--width", 16, "--latent", 4, "--threads", 1, "--device", "cpu"]
    result = bunraku(
        "train", "--model", "pose", "--recordings", recordings, "--out", tmp_path / "pose", *options
    )
    assert result.exit_code == 0, result.output
    assert "bunraku path" in " ".join(result.stderr.split())
    assert not (tmp_path / "pose" / "show.yaml").exists()
    again = bunraku("evaluate", tmp_path / "pose" / "checkpoint.pt", recordings / "sway_0.bvh")
    assert again.exit_code == 2 and "is a pose model, for bunraku path" in " ".join(again.stderr.split())
