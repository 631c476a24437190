"""A folder of small recordings, and a show trained on them by the command itself."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from typer.testing import CliRunner, Result

from appliance.pictures import figure
from appliance.studio import dance_files, standing_dance
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.commands import app
from appliance.studio.data.dataset import load_dataset
from appliance.studio.evaluation import answer_picture, own_answer, pictures
from appliance.studio.experiments import strips
from appliance.studio.granular import walk
from appliance.studio.improviser import own_output
from appliance.studio.improviser.footing import plant_feet
from appliance.studio.pose_space import path
from appliance.studio.variations import sweep, vary
from tests.studio.tiny import write_recordings


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def _seeded_torch() -> None:
    """torch draws the same numbers in a test that runs alone as in one that runs after others."""
    torch.manual_seed(1)


@pytest.fixture(scope="session", autouse=True)
def _small_answers() -> Iterator[None]:
    """What training ends with is measured on little, strips have two figures of whole pixels, and feet are
    planted in few steps.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(answer_picture, "COLUMNS", 2)
        patch.setattr(own_answer, "MOST_TICKS", 150)
        for module in (pictures, sweep, vary, path, own_output, strips):
            patch.setattr(module, "COLUMNS", 2)
        patch.setattr(figure, "SUPERSAMPLE", 1)
        for module in (standing_dance, walk):
            patch.setattr(module, "plant_feet", lambda dance: plant_feet(dance, 20))
        patch.setattr(sweep, "WINDOWS", 3)
        patch.setattr(own_output, "SECONDS", 2.0)
        patch.setattr(own_output, "DANCES", 1)
        yield


@pytest.fixture
def quickly_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """Generated dances get no picture, and their feet are hardly planted: both take seconds."""
    monkeypatch.setattr(dance_files, "draw_filmstrip", lambda *_, **__: None)
    monkeypatch.setattr(standing_dance, "plant_feet", lambda dance: plant_feet(dance, 2))


def bunraku(*arguments: object) -> Result:
    """Run a command of the studio as from a shell."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three takes of four seconds."""
    return write_recordings(tmp_path_factory.mktemp("recordings") / "dancer")


@pytest.fixture(scope="session")
def puppet_checkpoint(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Path:
    """checkpoint.pt of a puppet that has hardly begun."""
    path = tmp_path_factory.mktemp("puppet") / "checkpoint.pt"
    Training(load_dataset(recordings), Settings(network="mlp", width=16, latent=8)).save_checkpoint(path)
    return path


@pytest.fixture(scope="session")
def pose_checkpoint(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Path:
    """checkpoint.pt of a pose model after 300 steps."""
    out = tmp_path_factory.mktemp("pose")
    options = ["--steps", 300, "--width", 48, "--latent", 6, "--threads", 1]
    result = bunraku("train", "--model", "pose", "--recordings", recordings, "--out", out, *options)
    assert result.exit_code == 0, result.output
    return out / "checkpoint.pt"


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> tuple[Path, Result]:
    """A show after 60 steps of a tiny mlp, and what the command said."""
    show = tmp_path_factory.mktemp("trained") / "evening"
    options = ["--steps", 60, "--width", 48, "--latent", 16, "--threads", 1, "--device", "cpu"]
    return show, bunraku("train", "--recordings", recordings, "--out", show, *options)
