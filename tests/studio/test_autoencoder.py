"""The iteration in PyTorch: headings, held joints, and the prior that shapes the latent."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from appliance.studio.autoencoder import losses, rotation
from appliance.studio.autoencoder.architectures import NETWORKS
from appliance.studio.autoencoder.autoencoder import Autoencoder, PriorCritic
from appliance.studio.autoencoder.coupled import BODY, CALM, Coupled, matrix_of_products
from appliance.studio.autoencoder.held_joints import HeldJoints
from tests.studio.tiny import moving, swaying, untrained


def some_windows(count: int = 6) -> Tensor:
    poses = swaying(3.0).poses[:, moving()].astype(np.float32)
    starts = np.linspace(0, len(poses) - 8, count).astype(int)
    return torch.from_numpy(poses[starts[:, None] + np.arange(8)])


def turned(windows: Tensor, degrees: float) -> Tensor:
    """The same dance seen from another side: its root turned about the vertical."""
    half = np.radians(degrees) / 2
    turn = torch.tensor([np.cos(half), 0.0, np.sin(half), 0.0], dtype=torch.float32)
    root = rotation.multiply(turn.expand_as(windows[:, :, 0]), windows[:, :, 0])
    return torch.cat([root[:, :, None], windows[:, :, 1:]], dim=2)


def held(autoencoder: Autoencoder) -> HeldJoints[Tensor]:
    mask = torch.zeros(autoencoder.shape.joints, dtype=torch.bool)
    mask[6] = True
    targets = rotation.normalize(torch.randn(8, autoencoder.shape.joints, 4))
    return HeldJoints(mask, targets, torch.ones(autoencoder.shape.joints))


@pytest.mark.parametrize("degrees", [30.0, 90.0, 179.0, -120.0])
def test_a_dance_turned_about_the_vertical_gives_the_same_dance_turned(degrees: float) -> None:
    """Why no training data has to be turned about the vertical: every heading is the same to the network."""
    autoencoder = untrained()
    windows, hand = some_windows(), held(autoencoder)
    straight, latents = autoencoder.iterate(windows, 3, 2, hand)
    made, same = autoencoder.iterate(turned(windows, degrees), 3, 2, hand)
    apart = rotation.angle_between(made, turned(straight, degrees))
    assert torch.rad2deg(apart).max() < 0.05
    torch.testing.assert_close(same, latents, atol=1e-4, rtol=0)


def test_a_free_last_pass_does_not_show_the_held_orientation() -> None:
    autoencoder = untrained()
    hand = held(autoencoder)
    shown, _ = autoencoder.iterate(some_windows(), 4, 4, hand)
    free, _ = autoencoder.iterate(some_windows(), 4, 3, hand)
    goal = hand.targets[:, 6].expand(6, 8, 4)
    assert torch.rad2deg(rotation.angle_between(shown[:, :, 6], goal)).max() < 0.1
    assert torch.rad2deg(rotation.angle_between(free[:, :, 6], goal)).min() > 5.0


def test_a_weight_of_a_half_goes_half_the_way() -> None:
    autoencoder = untrained()
    hand = held(autoencoder)
    firm, _ = autoencoder.iterate(some_windows(), 1, 1, hand)
    loose, _ = autoencoder.iterate(some_windows(), 1, 1, hand._replace(weights=0.0 * hand.weights))
    half, _ = autoencoder.iterate(some_windows(), 1, 1, hand._replace(weights=0.5 * hand.weights))
    way = rotation.angle_between(loose[:, :, 6], firm[:, :, 6])
    assert way.max() > 0.5
    # The pass in between sees the half-held joint, so the ends of the two ways are not quite the same.
    torch.testing.assert_close(
        rotation.angle_between(half[:, :, 6], firm[:, :, 6]), way / 2, atol=0.05, rtol=0
    )


def test_each_window_of_a_batch_may_have_targets_and_weights_of_its_own() -> None:
    autoencoder = untrained()
    windows, hands = some_windows(3), [held(autoencoder) for _ in range(3)]
    targets = torch.stack([hand.targets for hand in hands])
    weights = torch.tensor([0.0, 0.4, 1.0])[:, None].expand(-1, autoencoder.shape.joints)
    together, _ = autoencoder.iterate(windows, 3, 2, HeldJoints(hands[0].mask, targets, weights))
    for place, hand in enumerate(hands):
        alone, _ = autoencoder.iterate(windows[place][None], 3, 2, hand._replace(weights=weights[place]))
        torch.testing.assert_close(together[place], alone[0], atol=1e-5, rtol=0)


def coupled_pull(autoencoder: Autoencoder, goal: Tensor, held: Tensor, **changed: Tensor) -> Tensor:
    network, windows = autoencoder.network, some_windows()
    assert isinstance(network, Coupled)
    meant = torch.where(held[:, None, :, None] > 0, goal, windows)
    latents, whole = (autoencoder.encode(windows), autoencoder.encode(meant)), torch.ones(len(windows))
    given = {"liveliness": whole, "noise": torch.zeros_like(latents[0]), **changed}
    return network.pull(latents, windows, meant, held, **given)


def holding(autoencoder: Autoencoder, joint: int = 3) -> Tensor:
    held = torch.zeros(len(some_windows()), autoencoder.shape.joints)
    held[:, joint] = 1.0
    return held


def test_a_coupled_network_sees_rotations_not_quaternions() -> None:
    """A target and its negative are the same rotation: a hand that passes half a turn makes no jump."""
    autoencoder, goal = untrained("coupled"), some_windows().roll(1, 0)
    held, latents, network = holding(autoencoder), autoencoder.encode(some_windows()), autoencoder.network
    assert isinstance(network, Coupled)
    there = network.hands(latents, goal, held)
    assert (there - network.hands(latents, some_windows(), held)).abs().max() > 1e-3
    torch.testing.assert_close(network.hands(latents, -goal, held), there)
    elsewhere = goal.clone()
    elsewhere[:, :, 5] = goal[:, :, 4]  # where joints that nothing holds are wanted does not matter
    torch.testing.assert_close(network.hands(latents, elsewhere, held), there)


def test_a_pull_takes_more_of_the_body_and_no_more_of_the_held_joint() -> None:
    autoencoder, windows = untrained("coupled"), some_windows()
    held, goal = holding(autoencoder), windows.roll(1, 0)
    network, latents = autoencoder.network, autoencoder.encode(windows)
    assert isinstance(network, Coupled)
    pasted = torch.where(held[:, None, :, None] > 0, goal, windows)
    copied = autoencoder.encode(pasted) - latents
    learned = network.hands(latents, goal, held) - network.hands(latents, windows, held)
    beyond = coupled_pull(autoencoder, goal, held) - copied
    torch.testing.assert_close(beyond, (1 + BODY) * (learned - copied), atol=1e-5, rtol=0)


def test_a_hand_where_the_phrase_has_its_joint_pulls_nothing() -> None:
    autoencoder = untrained("coupled")
    pull = coupled_pull(autoencoder, some_windows(), holding(autoencoder))
    torch.testing.assert_close(pull, torch.zeros_like(pull), atol=1e-6, rtol=0)


def test_less_liveliness_leaves_less_of_the_phrases_own() -> None:
    """Without liveliness, CALM of what distinguishes the window from the usual one stays."""
    autoencoder, windows = untrained("coupled"), some_windows()
    assert isinstance(autoencoder.network, Coupled)
    held, latents = holding(autoencoder), autoencoder.encode(windows)
    usual = autoencoder.network.hands(latents, windows, held)
    pull = coupled_pull(autoencoder, windows, held, liveliness=torch.zeros(len(windows)))
    torch.testing.assert_close(latents + pull - usual, CALM * (latents - usual), atol=1e-5, rtol=0)


def test_noise_moves_a_held_dance_and_no_free_one() -> None:
    autoencoder, windows = untrained("coupled"), some_windows()
    noise = torch.ones(autoencoder.shape.latent)
    hand = held(autoencoder)
    plain, drawn = (autoencoder.iterate(windows, 3, 2, hand, noise=each)[0] for each in (None, noise))
    assert rotation.angle_between(plain, drawn).max() > 1e-4
    plain, drawn = (autoencoder.iterate(windows, 3, 0, None, noise=each)[0] for each in (None, noise))
    assert torch.equal(plain, drawn)


def test_a_hand_without_weight_is_no_hand() -> None:
    autoencoder, windows = untrained("coupled"), some_windows()
    hand = held(autoencoder)
    nothing = hand._replace(weights=torch.zeros_like(hand.weights))
    made, free = autoencoder.iterate(windows, 3, 2, nothing)[0], autoencoder.iterate(windows, 3)[0]
    torch.testing.assert_close(made, free)


def test_the_matrix_of_products_is_the_rotation() -> None:
    turn = torch.nn.functional.normalize(torch.randn(50, 4), dim=-1)
    matrices = ((turn[:, :, None] * turn[:, None, :]).flatten(1) @ matrix_of_products()).view(-1, 3, 3)
    vectors = torch.randn(50, 3)
    torch.testing.assert_close(
        (matrices @ vectors[..., None])[..., 0], rotation.rotate(turn, vectors), atol=1e-5, rtol=1e-4
    )


@pytest.mark.parametrize("network", sorted(NETWORKS))
def test_the_priors_gradient_reaches_every_layer_of_the_encoder(network: str) -> None:
    """The published code of the paper's line has exactly zero here: its critic runs without gradients."""
    autoencoder = untrained(network).requires_grad_(True)
    critic = PriorCritic(autoencoder.shape.latent)
    windows = some_windows()
    losses.prior_loss(critic, autoencoder.encode(windows)).backward()
    for name, parameter in autoencoder.network.encoder.named_parameters():
        assert parameter.grad is not None and parameter.grad.abs().max() > 0, name
    assert all(p.grad is None for p in autoencoder.network.decoder.parameters())


def test_the_critics_own_loss_leaves_the_encoder_alone() -> None:
    autoencoder = untrained().requires_grad_(True)
    latents = autoencoder.encode(some_windows())
    losses.critic_loss(PriorCritic(autoencoder.shape.latent), latents, torch.randn_like(latents)).backward()
    assert all(p.grad is None for p in autoencoder.parameters())


def test_the_critic_learns_to_tell_latents_from_the_prior() -> None:
    torch.manual_seed(3)
    critic = PriorCritic(8)
    optimizer = torch.optim.Adam(critic.parameters(), lr=1e-3)
    for _ in range(60):
        loss = losses.critic_loss(critic, 0.3 * torch.randn(64, 8) + 0.5, torch.randn(64, 8))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    made, true = critic(0.3 * torch.randn(256, 8) + 0.5), critic(torch.randn(256, 8))
    assert ((made < 0).float().mean() + (true > 0).float().mean()) / 2 > 0.9


def test_the_figure_of_moving_joints_is_the_whole_figure() -> None:
    """Forward kinematics for the losses folds still joints in; the box's own says where joints really are."""
    dance = swaying(1.0)
    dance.poses[:, [5, 9]] = rotation.normalize(torch.tensor([1.0, 0.1, -0.2, 0.3])).numpy()  # the collars
    bones = rotation.moving_bones(dance.skeleton, moving(), torch.tensor(dance.poses[0]))
    body = rotation.MovingSkeleton(bones)
    found = body(torch.from_numpy(dance.poses[:, moving()].astype(np.float32)))
    places, _ = dance.skeleton.forward_kinematics(dance.poses, np.zeros_like(dance.roots))
    np.testing.assert_allclose(found.numpy(), places[:, moving()], atol=1e-5)


def bones_of_tiny() -> rotation.Bones:
    return rotation.moving_bones(swaying(1.0).skeleton, moving(), torch.tensor(swaying(1.0).poses[0]))


def test_a_perfect_reconstruction_costs_nothing() -> None:
    windows, every = some_windows(), losses.LossWeights(squared=1.0, speed=1.0)
    body = rotation.MovingSkeleton(bones_of_tiny())
    for name, loss in losses.reconstruction_losses(windows, windows, body, every).items():
        assert float(loss) < 3e-4, name
    wrong = 1.2 * windows.flip(0)
    wrong[:, 1:] = wrong[:, :1]  # and standing still
    for name, loss in losses.reconstruction_losses(wrong, windows, body, every).items():
        assert float(loss) > 1e-3, name
