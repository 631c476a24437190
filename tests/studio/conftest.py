"""A folder of small recordings, and what the command itself trained on them: once for all workers."""

from __future__ import annotations

import fcntl
import json
import os
import pickle
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import torch
from typer.testing import CliRunner, Result

from appliance.body import mesh_file
from appliance.pictures import figure
from appliance.pose.recording import Recording
from appliance.studio import dance_files, standing_dance
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.commands import app
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.evaluation import answer_picture, own_answer, pictures
from appliance.studio.experiments import strips
from appliance.studio.export import release
from appliance.studio.granular import walk
from appliance.studio.improviser import own_output
from appliance.studio.improviser.footing import Progress, plant_feet
from appliance.studio.pose_space import explore, path
from appliance.studio.variations import sweep, vary
from tests.known_surfaces import each_surface_once
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
        for module in (pictures, sweep, vary, path, explore, own_output, strips):
            patch.setattr(module, "COLUMNS", 2)
        patch.setattr(figure, "SUPERSAMPLE", 1)
        for module in (standing_dance, walk):
            patch.setattr(module, "plant_feet", _planting(20))
        patch.setattr(sweep, "WINDOWS", 3)
        patch.setattr(own_output, "SECONDS", 2.0)
        patch.setattr(own_output, "DANCES", 1)
        yield


@pytest.fixture(scope="session", autouse=True)
def _one_surface_a_figure() -> Iterator[None]:
    with each_surface_once(mesh_file):
        yield


def _planting(steps: int) -> Callable[..., Recording]:
    def plant(dance: Recording, progress: Progress = iter) -> Recording:
        return plant_feet(dance, steps, progress)

    return plant


@pytest.fixture
def quickly_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """Generated dances get no picture, and their feet are hardly planted: both take seconds."""
    monkeypatch.setattr(dance_files, "draw_filmstrip", lambda *_, **__: None)
    monkeypatch.setattr(standing_dance, "plant_feet", _planting(2))


@pytest.fixture
def unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shows are written without the figures of their answer to a hand, which take most of the time."""
    monkeypatch.setattr(release, "own_answer", lambda *_: {"not_measured": "this test does not ask"})


def bunraku(*arguments: object) -> Result:
    """Run a command of the studio as from a shell."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


@dataclass(frozen=True)
class Said:
    """How a command ended that another worker may have run."""

    exit_code: int
    output: str
    stderr: str


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder for reading that one of the workers of a run makes for all of them."""
    base = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent
    folder, whole = base / name, base / f"{name}.whole"
    with (base / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not whole.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            make(folder)
            whole.touch()
    return folder


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three takes of four seconds."""
    return made_once(tmp_path_factory, "three-takes", lambda out: write_recordings(out / "dancer")) / "dancer"


@pytest.fixture(scope="session")
def dances(tmp_path_factory: pytest.TempPathFactory, recordings_dir: Path) -> Dataset:
    """The motion capture recordings to train on. To read them and to find their errors takes ten seconds."""

    def read(out: Path) -> None:
        (out / "dataset").write_bytes(pickle.dumps(load_dataset(recordings_dir / "train")))

    found = pickle.loads((made_once(tmp_path_factory, "dances", read) / "dataset").read_bytes())
    assert isinstance(found, Dataset)
    return found


@pytest.fixture(scope="session")
def puppet_checkpoint(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Path:
    """checkpoint.pt of a puppet that has hardly begun."""
    path = tmp_path_factory.mktemp("puppet") / "checkpoint.pt"
    Training(load_dataset(recordings), Settings(network="mlp", width=16, latent=8)).save_checkpoint(path)
    return path


@pytest.fixture(scope="session")
def pose_checkpoint(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Path:
    """checkpoint.pt of a pose model after 300 steps."""
    options = ["--steps", 300, "--width", 48, "--latent", 6, "--threads", 1]

    def train(out: Path) -> None:
        result = bunraku("train", "--model", "pose", "--recordings", recordings, "--out", out, *options)
        assert result.exit_code == 0, result.output

    return made_once(tmp_path_factory, "pose", train) / "checkpoint.pt"


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> tuple[Path, Said]:
    """A show after 20 steps of a tiny network, and what the command said."""
    options = ["--steps", 20, "--width", 48, "--latent", 16, "--threads", 1, "--device", "cpu"]

    def train(folder: Path) -> None:
        result = bunraku("train", "--recordings", recordings, "--out", folder / "evening", *options)
        printed = {"exit_code": result.exit_code, "output": result.output, "stderr": result.stderr}
        (folder / "said.json").write_text(json.dumps(printed))

    folder = made_once(tmp_path_factory, "trained", train)
    return folder / "evening", Said(**json.loads((folder / "said.json").read_text()))
