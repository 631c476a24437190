"""Training in several processes: together they learn what one would, also where another number goes on."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from appliance.studio.autoencoder.models import settings_for
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.data.sources import given
from appliance.studio.processes import Processes
from appliance.studio.studio_error import StudioError
from appliance.studio.training_loop import mixed_precision
from tests.studio.conftest import bunraku

STEPS, STOPPED = 24, 9
TORCHRUN = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", "-m", "appliance.cli"]


@pytest.fixture(scope="module")
def dancer(recordings: Path) -> Dataset:
    return load_dataset(recordings)


def two_processes(*arguments: object) -> subprocess.CompletedProcess[str]:
    """bunraku with these arguments under torchrun."""
    return subprocess.run(
        [sys.executable, *TORCHRUN, *map(str, arguments)],
        env={**os.environ, "OMP_NUM_THREADS": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def small(recordings: Path, network: str = "mlp") -> Training:
    settings = settings_for("pose", network, latent=4, width=16, learning_rate=3e-3)
    assert isinstance(settings, Settings)
    training = Training(load_dataset(recordings), replace(settings, steps=STEPS))
    training.origin = given(recordings).as_state()
    return training


def test_two_processes_learn_what_one_does_and_go_on_where_one_stopped_and_one_after_them(
    recordings: Path, tmp_path: Path
) -> None:
    """The same batches, noise and weights, to the rounding of sums; the loss curves with them."""
    whole = small(recordings)
    whole.run(lambda line: None, lambda: whole.save_checkpoint(tmp_path / "whole.pt"))
    (tmp_path / "two").mkdir()
    part = small(recordings)
    curve = [float(part.train_step()["rotation"]) for _ in range(STOPPED)]
    part.save_checkpoint(tmp_path / "two" / "checkpoint.pt")
    result = two_processes("train", "--resume", "--out", tmp_path / "two", "--threads", 1, "--device", "cpu")
    assert result.returncode == 0, result.stderr
    assert "in each of 2 processes, 38 % done" in " ".join(result.stderr.split())
    assert result.stderr.count("is ready") == 1, "one process speaks"
    one, two = (torch.load(tmp_path / name, weights_only=True) for name in ("whole.pt", "two/checkpoint.pt"))
    assert two["step"] == one["step"] == STEPS
    for name, value in one["averaged"].items():
        torch.testing.assert_close(two["averaged"][name], value, atol=1e-5, rtol=1e-4, msg=name)
    mean = one["history"][-1]["losses"]["rotation"]
    later = two["history"][-1]["losses"]["rotation"]
    again = bunraku("train", "--resume", "--out", tmp_path / "two", "--steps", STEPS + 2, "--device", "cpu")
    assert again.exit_code == 0, again.output
    assert torch.load(tmp_path / "two" / "checkpoint.pt", weights_only=True)["step"] == STEPS + 2
    assert (sum(curve) + later * (STEPS - STOPPED)) / STEPS == pytest.approx(mean, rel=1e-4)
    assert two["history"][-1]["held_out_degrees"] == pytest.approx(
        one["history"][-1]["held_out_degrees"], rel=1e-4
    )


def test_one_improviser_goes_on_where_two_processes_stopped(
    recordings: Path, tmp_path: Path, long_run: bool
) -> None:
    if not long_run:
        pytest.skip("another model: --long")
    sizes = ["--window", 10, "--width", 12, "--depth", 1, "--mixtures", 2, "--threads", 1, "--device", "cpu"]
    arguments = ["--model", "improviser", "--network", "lstm-mixtures", "--recordings", recordings]
    result = two_processes("train", *arguments, *sizes, "--steps", 6, "--out", tmp_path / "two")
    assert result.returncode == 0, result.stderr
    state = torch.load(tmp_path / "two" / "checkpoint.pt", weights_only=True)
    assert state["step"] == 6 and (tmp_path / "two" / "report.json").exists()
    again = bunraku("train", "--resume", "--out", tmp_path / "two", "--steps", 8, "--device", "cpu")
    assert again.exit_code == 0, again.output
    assert torch.load(tmp_path / "two" / "checkpoint.pt", weights_only=True)["step"] == 8


def test_shares_are_the_whole_batch_and_gradients_their_mean() -> None:
    rows, both = torch.arange(12), [Processes(rank, 2) for rank in range(2)]
    assert sorted(torch.cat([each.share(rows) for each in both]).tolist()) == rows.tolist()
    noise = []
    for each in (Processes(), *both):
        torch.manual_seed(3)
        noise.append(each.noise(torch.empty(6 // each.count, 4)))
    torch.testing.assert_close(torch.stack(noise[1:], 1).flatten(0, 1), noise[0])


def test_processes_that_answer_hands_draw_lessons_of_their_own(dancer: Dataset) -> None:
    settings = Settings(steps=4, width=16, latent=8, batch=32)
    drawn: list[Any] = []
    for rank in (0, 1):
        training = Training(dancer, settings, processes=Processes(rank, 2))
        drawn.append(training.batches.draw(16)[0].windows)
    assert drawn[0].shape == drawn[1].shape and not torch.equal(*drawn)


def test_a_batch_that_cannot_be_shared_evenly_is_refused(dancer: Dataset) -> None:
    with pytest.raises(StudioError, match="3 processes cannot share a batch of 32 evenly"):
        Training(dancer, Settings(batch=32), processes=Processes(0, 3))


def test_networks_compute_in_bfloat16_on_a_gpu_alone(dancer: Dataset) -> None:
    assert not mixed_precision(torch.device("cpu"), True)._enabled
    with pytest.MonkeyPatch.context() as patch:
        asked: list[tuple[Any, ...]] = []
        patch.setattr(torch, "autocast", lambda *kind, **switch: asked.append((*kind, switch["enabled"])))
        for wanted in (True, False):
            mixed_precision(torch.device("cuda"), wanted)
    assert asked == [("cuda", torch.bfloat16, True), ("cuda", torch.bfloat16, False)]


@pytest.mark.parametrize("network", ["mlp", "coupled"])
def test_losses_stay_fp32_where_networks_compute_in_bfloat16(dancer: Dataset, network: str) -> None:
    """As on a GPU, by the processor's own bfloat16."""
    training = Training(dancer, Settings(network=network, steps=30, width=32, latent=8, batch=32))
    training.mixed = torch.autocast("cpu", torch.bfloat16)
    reported = [training.train_step() for _ in range(30)]
    assert {part.dtype for part in reported[-1].values()} == {torch.float32}
    assert reported[-1]["rotation"] < reported[0]["rotation"]
    assert {one.dtype for one in training.autoencoder.parameters()} == {torch.float32}
