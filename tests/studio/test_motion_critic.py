"""The motion critic: what it sees of a dance, and that it tells calm and trembling dances from the dancer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from appliance.dancer.extrapolation import Extrapolation
from appliance.pose import quaternion
from appliance.studio.autoencoder import motion_critic, rotation
from appliance.studio.autoencoder.motion_critic import HOP, WINDOWS, MotionCritic, Sequences, extrapolated
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.evaluation.in_play import blended
from tests.studio.tiny import write_recordings

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def dancer(recordings: Path) -> Dataset:
    return load_dataset(recordings)


@pytest.fixture(scope="module")
def sequences(dancer: Dataset) -> Sequences:
    return Sequences(dancer, 8, CPU)


def degrees(one: Tensor, other: Tensor) -> Tensor:
    return torch.rad2deg(rotation.angle_between(one, other))


def test_a_sequence_is_what_was_recorded_one_window_every_second_tick(sequences: Sequences) -> None:
    torch.manual_seed(1)
    windows = sequences.draw(5).windows
    assert windows.shape[:3] == (5, WINDOWS, 8)
    assert degrees(windows[:, 1:, 0], windows[:, :-1, HOP]).max() < 0.05


def test_targets_are_what_the_box_makes_of_the_joints_as_hands(dancer: Dataset) -> None:
    take = quaternion.continuous(dancer.training[0].recording.poses[:, dancer.moving]).astype(np.float32)
    extrapolation = Extrapolation(take.shape[1], 8)
    out = np.empty((8, take.shape[1], 4), dtype=np.float32)
    for tick, pose in enumerate(take[:31]):
        extrapolation(pose, np.full((len(pose), 1), tick == 0), out)
    found = extrapolated(take, 8)[30]
    assert np.degrees(quaternion.angle_between(found, out)).max() < 0.05


def test_motion_is_blended_as_in_the_box(sequences: Sequences) -> None:
    """Every second window stands for the one that is left out: the difference is small beside the motion."""
    torch.manual_seed(2)
    windows = sequences.draw(1).windows
    motion = motion_critic.blended(windows)[0]
    assert len(motion) == motion_critic.blended_poses(8)
    assert degrees(motion, windows[0, 3:, 0]).max() < 0.05  # windows of one motion agree: nothing is mixed
    apart = windows.clone()
    apart[:, -1] = apart[:, 0]
    box = blended(apart[0].repeat_interleave(HOP, dim=0).numpy())
    assert degrees(motion_critic.blended(apart)[0, -1], torch.from_numpy(box[-HOP])).max() < 15


def test_a_root_held_by_another_dance_keeps_the_heading_of_the_phrase(sequences: Sequences) -> None:
    torch.manual_seed(3)
    dance, hand = sequences.draw(4), sequences.draw(4)
    goal = hand.as_hands_of(dance.windows)
    own = motion_critic.rotation.heading(dance.windows[:, :, 4, 0])
    turned = rotation.multiply(
        own, rotation.inverse(motion_critic.rotation.heading(hand.windows[:, :, 4, 0]))
    )
    expected = rotation.multiply(turned, hand.targets[:, :, 4, 0])
    assert degrees(goal[:, :, 4, 0], expected).max() < 0.1
    torch.testing.assert_close(goal[..., 1:, :], hand.targets[..., 1:, :])


def trained_critic(sequences: Sequences, spoil: float, tremble: float) -> float:
    """How often a critic of 150 steps tells a dance, calmed by `spoil` and with `tremble` degrees, apart."""
    torch.manual_seed(4)

    def made(count: int) -> Tensor:
        motion = motion_critic.level(motion_critic.blended(sequences.draw(count).windows))[0]
        calm = motion + spoil * (motion.mean(1, keepdim=True) - motion)
        return rotation.normalize(calm + np.radians(tremble) / 2 * torch.randn_like(calm))

    real = motion_critic.level(motion_critic.blended(sequences.draw(200).windows))[0]
    critic = MotionCritic(real.shape[2], real.shape[1], width=48)
    critic.measure(real)
    optimizer = torch.optim.Adam(critic.parameters(), lr=2e-3)
    nobody = torch.zeros(64, real.shape[2])

    def features(motion: Tensor) -> Tensor:
        return critic.features(motion, motion[:, 0], nobody)

    for step in range(150):
        true = motion_critic.level(motion_critic.blended(sequences.draw(64).windows))[0]
        loss = motion_critic.critic_loss(critic, features(true), features(made(64)), step % 4 == 0)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    with torch.no_grad():
        return float((critic(features(real[:64])) > critic(features(made(64)))).float().mean())


@pytest.mark.parametrize(
    ("spoil", "tremble", "least", "most"), [(0.6, 0, 0.8, 1), (0, 4, 0.8, 1), (0, 0, 0, 0.7)]
)
def test_the_critic_tells_calm_and_trembling_dances_and_not_the_dancer(
    sequences: Sequences, spoil: float, tremble: float, least: float, most: float
) -> None:
    assert least <= trained_critic(sequences, spoil, tremble) <= most


def test_wandering_sequences_go_on_and_begin_anew(dancer: Dataset) -> None:
    torch.manual_seed(5)
    sequences = Sequences(dancer, 8, CPU)
    ages = []
    for _ in range(40):
        wandering = sequences.wandering(20)
        wandering.go_on(wandering.windows, 10)
        ages.append(float(sequences.state()["age"].max()))
    assert max(ages) >= 60, "some are coded a hundred times"
    assert float(sequences.state()["age"].min()) <= 10, "others have just begun"


@pytest.mark.parametrize(("window", "is_seen"), [(5, True), (20, True), (21, False), (64, False)])
def test_windows_of_any_length_are_trained_with_a_critic_where_it_sees_three_poses(
    window: int, is_seen: bool, tmp_path: Path
) -> None:
    dancer = load_dataset(write_recordings(tmp_path / "dancer", seconds=6.0))
    training = Training(dancer, Settings(window=window, width=16, latent=8, steps=2, batch=16))
    assert (training.sequences is not None) == is_seen
    if training.sequences is not None:
        motion = motion_critic.blended(training.sequences.draw(2).windows)
        assert motion.shape[1] == motion_critic.blended_poses(window) >= 3
    assert all(torch.isfinite(value) for value in training.train_step().values())
