"""The improviser: steps of recordings, moves, mixtures; it learns, resumes, and really draws."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.loop import turns_about_y
from appliance.dancer.material import steps
from appliance.dancer.material.improvising import BEFORE, FARTHEST, MOVE
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.studio.autoencoder.losses import divergence
from appliance.studio.data.dataset import Take
from appliance.studio.improviser.improviser import Improviser, Mixture
from appliance.studio.improviser.improviser_training import (
    ImproviserSettings,
    ImproviserTraining,
    load_improviser,
)
from appliance.studio.improviser.moves import MovesShape
from appliance.studio.improviser.steps import WindowCoder, steps_of_takes
from tests.studio.tiny import moving, swaying, untrained

TINY = ImproviserSettings(
    steps=100,
    kept=6,
    code=4,
    width=24,
    lstm_width=12,
    mixtures=2,
    batch=8,
    moves=2,
    learning_rate=5e-3,
    smoothing=0.9,
)


def walking(seconds: float = 6.0) -> Recording:
    """The swaying dancer on a curved way, turning; the floor half a metre up."""
    sway = swaying(seconds)
    time = np.arange(len(sway)) / sway.fps
    poses = sway.poses.copy()
    poses[:, 0] = quaternion.multiply(turns_about_y(0.8 * time), poses[:, 0])
    roots = sway.roots + np.stack([np.sin(time), np.full(len(time), 0.5), 0.3 * time], axis=1)
    return Recording(sway.skeleton, quaternion.continuous(poses), roots, sway.fps)


def waves(count: int = 3, length: int = 80) -> list[torch.Tensor]:
    """Smooth made-up steps (T, 8 + 4)."""
    time = torch.arange(length)[:, None] * 0.08
    rates = torch.linspace(1, 3, 12)[None]
    return [torch.sin(rates * time + phase) * torch.linspace(1, 0.1, 12) for phase in range(count)]


def test_the_roots_way_survives_becoming_steps() -> None:
    recording = walking()
    autoencoder = WindowCoder(untrained())
    made = steps.steps_of(autoencoder, recording, moving())
    _, roots = steps.motion_of(autoencoder, made, recording.poses[0], moving())
    first = steps.HOP + steps.MIDDLE  # the first step's own frame
    facing = quaternion.heading(recording.poses[steps.MIDDLE, 0])
    true = quaternion.rotate(quaternion.inverse(facing), recording.roots[first : first + len(roots)])
    off = (roots - roots[0]) - (true - true[0])
    assert len(roots) == steps.HOP * (len(made) - 1)
    assert np.abs(off[:, [0, 2]]).max() < 0.005
    assert np.abs(true[:, [0, 2]] - true[0, [0, 2]]).max() > 0.5  # it did go somewhere


def test_steps_do_not_know_where_the_dancer_stands_and_faces() -> None:
    recording = walking()
    turn = turns_about_y(np.array(2.0))
    poses = recording.poses.copy()
    poses[:, 0] = quaternion.multiply(turn, poses[:, 0])
    roots = quaternion.rotate(turn, recording.roots) + np.array([3.0, 0.7, -2.0])
    elsewhere = Recording(recording.skeleton, poses, roots, recording.fps)
    here, there = (steps.steps_of(WindowCoder(untrained()), r, moving()) for r in (recording, elsewhere))
    np.testing.assert_allclose(here.ways, there.ways, atol=1e-4)
    np.testing.assert_allclose(here.latents, there.latents, atol=1e-3)


def test_glitches_cut_a_take_into_stretches_of_which_each_is_mirrored_and_begun_four_times() -> None:
    recording = swaying(8.0)
    sound = np.ones(len(recording), dtype=bool)
    sound[190:200] = False
    take = Take("sway", "sway", recording, sound, 50.0, 50.0)
    found = steps_of_takes(untrained(), [take], moving(), shortest=8)
    assert len(found) == 2 * 2 * steps.HOP
    assert max(len(part) for part in found) < 200 / steps.HOP


def test_dancing_again_keeps_length_and_unit_norm_and_closes_a_cycle() -> None:
    cycle = swaying(3.0)
    coder = WindowCoder(untrained())
    again = steps.danced_again(coder, cycle.poses, moving(), cyclic=True)
    shifted = steps.danced_again(coder, np.roll(cycle.poses, -40, axis=0), moving(), cyclic=True)
    np.testing.assert_allclose(np.linalg.norm(again, axis=-1), 1.0, atol=1e-6)
    same = quaternion.angle_between(np.roll(again, -40, axis=0), shifted)
    assert np.degrees(same).max() < 0.1  # no frame is an end


def test_a_mixtures_likelihood_is_that_of_its_gaussians() -> None:
    logits = torch.tensor([[0.0, math.log(3.0)]])
    means = torch.tensor([[[0.0, 0.0], [1.0, -1.0]]])
    log_scales = torch.tensor([[[0.0, 0.0], [math.log(0.5), 0.0]]])
    x = torch.tensor([[0.5, 0.2]])
    parts = torch.distributions.Independent(torch.distributions.Normal(means, log_scales.exp()), 1)
    expected = torch.logsumexp(torch.log_softmax(logits, -1) + parts.log_prob(x[:, None]), -1)
    found = Mixture(logits, means, log_scales).negative_log_likelihood(x)
    torch.testing.assert_close(found, -expected / 2)


def test_a_mixture_draws_as_often_and_as_wide_as_it_says() -> None:
    count = 4000
    mixture = Mixture(
        torch.tensor([[0.0, math.log(3.0)]]).repeat(count, 1),
        torch.tensor([[[-5.0], [5.0]]]).repeat(count, 1, 1),
        torch.tensor([[[0.0], [math.log(2.0)]]]).repeat(count, 1, 1),
    )
    drawn = mixture.sample(1.0, np.random.default_rng(3))[:, 0]
    assert float((drawn > 0).float().mean()) == pytest.approx(0.75, abs=0.03)
    assert float(drawn[drawn > 0].std()) == pytest.approx(2.0, abs=0.15)
    coldest = mixture.sample(0.0, np.random.default_rng(3))[:, 0]
    assert set(coldest.tolist()) == {5.0}  # the middle of the likeliest


def test_training_learns_and_the_held_out_takes_are_told_apart() -> None:
    training = ImproviserTraining(waves(), waves(1), 4, TINY)
    first = training.held_out()["moves"]
    lines = []
    training.run(lines.append, lambda: None)
    assert lines[-1].fraction == 1.0 and training.step == TINY.steps
    assert lines[-1].held_out["moves"] < 0.5 * first


def test_a_resumed_training_is_the_same_training(tmp_path: Path) -> None:
    whole = ImproviserTraining(waves(), [], 4, TINY)
    for _ in range(6):
        whole.train_step()
    half = ImproviserTraining(waves(), [], 4, TINY)
    for _ in range(3):
        half.train_step()
    half.save_checkpoint(tmp_path / "half.pt")
    resumed = ImproviserTraining(waves(), [], 4, TINY)
    resumed.restore(torch.load(tmp_path / "half.pt", weights_only=True))
    for _ in range(3):
        resumed.train_step()
    for name, value in whole.averaged.state_dict().items():
        torch.testing.assert_close(resumed.averaged.state_dict()[name], value, msg=name)


def test_the_same_seed_dances_the_same_and_another_one_does_not(tmp_path: Path) -> None:
    training = ImproviserTraining(waves(), [], 4, TINY)
    training.run(lambda line: None, lambda: training.save_checkpoint(tmp_path / "i.pt"))
    improviser, _ = load_improviser(tmp_path / "i.pt")
    heard = torch.stack([wave[: BEFORE + 2 * MOVE] for wave in waves()])
    once, again, other = (improviser.improvise(heard, 20, 1.0, seed) for seed in (1, 1, 2))
    assert once.shape == (3, 20 * MOVE, 12)
    assert torch.equal(once, again)
    assert not torch.allclose(once, other)
    assert not torch.allclose(once, improviser.improvise(heard, 20, 0.0, 1))


def test_hours_of_an_improviser_that_learned_nothing_stay_within_bounds() -> None:
    training = ImproviserTraining(waves(), [], 4, TINY)
    heard = torch.stack([wave[: BEFORE + MOVE] for wave in waves()])
    danced = training.averaged.improvise(heard, 500, 2.0, 5)
    inside = training.averaged.scale.inside(danced)
    assert (inside.abs() < FARTHEST + 1e-3).all()
    assert inside.abs().max() > FARTHEST - 1e-3  # left alone it would have walked off


def test_too_little_heard_is_refused() -> None:
    improviser = Improviser(MovesShape(8, 6, 4, 4, 16), 8, 1, 2)
    with pytest.raises(ValueError, match="it takes 11"):
        improviser.improvise(torch.zeros(1, BEFORE + MOVE - 1, 12), 1, 1.0, 0)


def test_a_standard_gaussian_diverges_by_nothing() -> None:
    zero = torch.zeros(2, 5)
    assert float(divergence(zero, zero)) == 0.0
    assert float(divergence(zero + 1, zero)) == pytest.approx(2.5)
