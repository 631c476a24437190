"""Training: the error falls, the prior shapes the latent, and a stop loses nothing, bit for bit."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from rich.console import Console

from appliance.studio.autoencoder import losses
from appliance.studio.autoencoder.answers import AnswerSettings
from appliance.studio.autoencoder.batches import Batch
from appliance.studio.autoencoder.held_joints import HeldPlaces
from appliance.studio.autoencoder.losses import LossWeights
from appliance.studio.autoencoder.models import settings_for
from appliance.studio.autoencoder.repertoire import Nearness
from appliance.studio.autoencoder.training import Report, Settings, Training, load_autoencoder
from appliance.studio.autoencoder.training_run import TrainingRun
from appliance.studio.data.dataset import Catalogue, Dataset, load_dataset, windows
from appliance.studio.data.sources import given
from appliance.studio.processes import Processes
from appliance.studio.studio_error import StudioError
from appliance.studio.training_loop import mixed_precision
from tests.studio.conftest import bunraku

FEW = AnswerSettings(reserve=96, uses=2, nearness=Nearness(searched=256))
TINY = Settings(network="coupled", steps=40, width=32, latent=12, batch=32, answers=FEW, sequences=4)


@pytest.fixture(scope="module")
def dancer(recordings: Path) -> Dataset:
    return load_dataset(recordings)


def run(training: Training, path: Path, until: int | None = None) -> None:
    training.run(
        lambda report: None,
        lambda: training.save_checkpoint(path),
        stop=lambda: until is not None and training.step >= until,
    )


def same(one: Any, other: Any) -> bool:
    """Equal to the last bit, through dictionaries and lists."""
    if isinstance(one, torch.Tensor):
        return torch.equal(one, other)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)


@pytest.mark.parametrize("network", ["coupled", "mlp", "lstm"])
def test_interrupted_and_resumed_is_uninterrupted_bit_for_bit(
    dancer: Dataset, tmp_path: Path, network: str
) -> None:
    settings = replace(TINY, network=network)
    whole = Training(dancer, settings)
    run(whole, tmp_path / "whole.pt")

    stopped = Training(dancer, settings)
    run(stopped, tmp_path / "part.pt", until=17)
    assert stopped.step == 17 and stopped.fraction < 1
    torch.manual_seed(99)  # whatever happened in between
    resumed = Training(dancer, settings)
    resumed.restore(torch.load(tmp_path / "part.pt", weights_only=True))
    run(resumed, tmp_path / "part.pt")

    one, other = whole.state(), resumed.state()
    assert one["step"] == other["step"] == 40
    for name in (*whole.saved, "batches", "sequences", "random", "step"):
        assert same(one[name], other[name]), name
    assert one["history"][-1]["held_out_degrees"] == other["history"][-1]["held_out_degrees"]


@pytest.mark.parametrize("part", ["settings", "batches"])
def test_a_checkpoint_of_another_version_is_not_continued(
    recordings: Path, puppet_checkpoint: Path, tmp_path: Path, part: str
) -> None:
    state = torch.load(puppet_checkpoint, weights_only=True)
    if part == "settings":
        state["settings"]["of_tomorrow"] = 1
    else:
        del state["batches"]
    torch.save(state, tmp_path / "checkpoint.pt")
    result = bunraku("train", "--resume", "--out", tmp_path, "--recordings", recordings, "--device", "cpu")
    assert result.exit_code == 2
    assert "is of another version of Bunraku" in " ".join(result.stderr.split())


def test_a_strip_is_drawn_where_no_held_out_window_is_sound(recordings: Path, tmp_path: Path) -> None:
    dataset = load_dataset(recordings, Catalogue(mask={"sway_2": ((1.9, 2.1),)}))
    assert not len(windows(dataset.held_out, dataset.moving, window=128))
    settings = settings_for("sequence", window=128, width=16, latent=4, batch=4)
    assert isinstance(settings, Settings)
    run = TrainingRun(Training(dataset, settings), tmp_path, Console(quiet=True))
    run._draw_strip(Report(1, 60.0, 0.5, {}))
    assert (tmp_path / "pictures" / "filmstrip_050.png").exists()


def test_only_a_training_whose_motion_is_seen_has_a_motion_critic(dancer: Dataset) -> None:
    of_motion = {"motion_critic", "motion_optimizer"}
    seen = Training(dancer, TINY)
    assert of_motion < seen.state().keys()
    for settings in (replace(TINY, network="mlp"), replace(TINY, sequences=0)):
        training = Training(dancer, settings)
        training.train_step()
        state = training.state()
        assert not of_motion & state.keys()
        Training(dancer, settings).restore(state)
        older = {**state, **{name: seen.state()[name] for name in of_motion}}
        again = Training(dancer, settings)
        again.restore(older)  # earlier releases saved one that no step had touched
        assert same(again.state()["averaged"], state["averaged"])


def test_settings_of_an_older_checkpoint_are_read(dancer: Dataset) -> None:
    saved = Training(dancer, TINY).state()["settings"]
    assert Settings.from_state({**saved, "betas": (0.9, 0.999)}) == TINY


def test_the_seed_alone_decides(dancer: Dataset, tmp_path: Path) -> None:
    weights = []
    for seed in (1, 1, 2):
        training = Training(dancer, replace(TINY, seed=seed, steps=5))
        run(training, tmp_path / "seed.pt")
        weights.append(training.state()["averaged"])
    assert same(weights[0], weights[1]) and not same(weights[0], weights[2])


@pytest.mark.parametrize(("network", "steps", "rate"), [("mlp", 200, 1e-3), ("coupled", 150, 8e-3)])
def test_training_reduces_the_error(
    dancer: Dataset, tmp_path: Path, network: str, steps: int, rate: float
) -> None:
    training = Training(dancer, replace(TINY, network=network, steps=steps, width=64, learning_rate=rate))
    training.held_windows = training.train_windows  # the tiny takes have nothing in common to generalise
    before = training.held_out_degrees()
    run(training, tmp_path / "checkpoint.pt")
    after = training.held_out_degrees()
    assert before is not None and after is not None
    assert after < 0.8 * before
    last = training.history[-1]
    assert last.fraction == 1.0 and last.step == steps and last.held_out_degrees == after
    assert set(last.losses) >= {"rotation", "pace", "unit_norm", "position", "prior", "critic"}


def test_only_a_prior_of_some_weight_moves_the_encoder(dancer: Dataset) -> None:
    nothing = LossWeights(rotation=0.0, pace=0.0, unit_norm=0.0, position=0.0, prior=0.0)
    nothing = replace(nothing, pull=0.0, alive=0.0, off_hand=0.0)
    for prior, moves in ((0.0, False), (0.01, True)):
        training = Training(dancer, replace(TINY, weights=replace(nothing, prior=prior)))
        before = {k: v.clone() for k, v in training.autoencoder.network.encoder.state_dict().items()}
        training.train_step()
        after = training.autoencoder.network.encoder.state_dict()
        assert same(before, after) != moves


def test_the_prior_draws_the_latent_to_a_standard_gaussian(dancer: Dataset) -> None:
    """Encoder and critic alone, from latents that are far too narrow and off the middle."""
    training = Training(dancer, replace(TINY, latent=4, width=64))
    encoder, critic = training.autoencoder.network.encoder, training.critic
    with torch.no_grad():
        encoder.stack[-1].bias.add_(1.5)

    def off() -> float:
        with torch.no_grad():
            z = training.autoencoder.encode(training.train_windows)
        return float(z.mean(0).abs().mean() + (z.std(0) - 1).abs().mean())

    before = off()
    slow = torch.optim.Adam(encoder.parameters(), lr=1e-3)
    for _ in range(450):
        rows = torch.randint(len(training.train_windows), (64,))
        latents = training.autoencoder.encode(training.train_windows[rows])
        paid = losses.critic_loss(critic, latents, torch.randn_like(latents))
        training.critic_optimizer.zero_grad()
        paid.backward()
        training.critic_optimizer.step()
        slow.zero_grad()
        losses.prior_loss(critic, latents).backward()
        slow.step()
    assert before > 1.5
    assert off() < 0.5


def test_a_checkpoint_is_on_the_disk_before_it_takes_the_place_of_the_one_before(
    dancer: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    opened = Path("/proc/self/fd")
    monkeypatch.setattr(os, "fsync", lambda number: synced.append((opened / str(number)).readlink()))
    training = Training(dancer, replace(TINY, network="mlp"))
    training.save_checkpoint(tmp_path / "checkpoint.pt")
    assert synced == [tmp_path / ".checkpoint.part.pt", tmp_path]


def test_a_checkpoint_gives_the_averaged_network(dancer: Dataset, tmp_path: Path) -> None:
    training = Training(dancer, replace(TINY, steps=5))
    run(training, tmp_path / "checkpoint.pt")
    autoencoder, joints, state = load_autoencoder(tmp_path / "checkpoint.pt")
    windows = training.held_windows[:4]
    made, made_then = autoencoder.iterate(windows, 2)[0], training.averaged.iterate(windows, 2)[0]
    torch.testing.assert_close(made, made_then, atol=1e-4, rtol=0)
    latents = autoencoder.encode(training.train_windows)
    assert latents.mean(0).abs().max() < 0.05 and (latents.std(0) - 1).abs().max() < 0.05
    assert tuple(joints) == dancer.moving_names and state["step"] == 5


def test_only_the_place_encoder_learns_from_places_and_joints_come_nearer_pass_by_pass(
    dancer: Dataset,
) -> None:
    training = Training(dancer, TINY)
    autoencoder, network = training.autoencoder, training.autoencoder.network
    windows = training.train_windows
    training._place_loss(windows[:8], autoencoder.encode(windows[:8])).backward()
    for name, parameter in network.named_parameters():
        assert (parameter.grad is not None) == name.startswith("places."), name
    for _ in range(200):  # windows must come back from the latent before a latent can move them
        rows = torch.randint(len(windows), (64,))
        _, parts = training._code(Batch(windows[rows], windows[rows]))
        training.optimizer.zero_grad()
        (parts["rotation"] + parts["position"] + parts["place"]).backward()
        training.optimizer.step()
    joint = dancer.moving_names.index("rForeArm")
    weights = torch.zeros(len(dancer.moving))
    weights[joint] = 1.0
    goal = network.places.where(windows).roll(len(windows) // 3, 0)
    off = []
    with torch.no_grad():
        for passes in (0, 1, 3, 6):
            made = autoencoder.iterate(windows, passes + 1, passes, placed=HeldPlaces(goal, weights))[0]
            off.append(float((network.places.where(made) - goal)[:, joint].norm(dim=-1).mean()))
    assert off[1] < off[0] and off[2] < off[1] and off[3] < 0.7 * off[0], off


def test_every_joint_is_held_in_some_lesson_also_one_without_a_bone_below_it(dancer: Dataset) -> None:
    without_ends = replace(dancer, skeleton=replace(dancer.skeleton, ends=()))
    assert Training(without_ends, TINY).holding_chances().min() > 0.1


STEPS, STOPPED = 24, 9
TORCHRUN = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", "-m", "appliance.cli"]


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
    settings = replace(TINY, steps=4)
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
    training = Training(dancer, replace(TINY, network=network, steps=30))
    training.mixed = torch.autocast("cpu", torch.bfloat16)
    reported = [training.train_step() for _ in range(30)]
    assert {part.dtype for part in reported[-1].values()} == {torch.float32}
    assert reported[-1]["rotation"] < reported[0]["rotation"]
    assert {one.dtype for one in training.autoencoder.parameters()} == {torch.float32}
