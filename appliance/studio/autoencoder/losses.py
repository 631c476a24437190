"""Losses of the autoencoder: rotations, their pace, unit norm, positions, and the prior."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import PriorCritic

POSITION_POSES = 2  # poses of a window's 8, redrawn each step: as good a gradient at a quarter of the cost


@dataclass(frozen=True)
class LossWeights:
    """Weights of the losses. Unit norm and positions as in the papers; the others as measured."""

    rotation: float = 1.0
    pace: float = 1.0
    unit_norm: float = 0.1
    position: float = 1.0
    squared: float = 0.0  # squared error of quaternions' components: the published loss of 'Beyond Imitation'
    prior: float = 0.003  # weight of the adversarial prior; 0: none
    speed: float = 0.0  # how much each joint moves within windows, as a mean over the batch
    divergence: float = 0.001  # divergence of a variational network's latents from the prior
    pull: float = 1.0  # a hand's pull on the latent, mean square
    place: float = 1.0  # the place encoder's guess at the latent, mean square
    alive: float = 0.05  # the motion critic's loss
    off_hand: float = 0.06  # distance of held joints from their hands


def reconstruction_losses(
    raw: Tensor, windows: Tensor, body: rotation.MovingSkeleton, weights: LossWeights
) -> dict[str, Tensor]:
    """Losses of raw decoded quaternions (B, T, M, 4) against heading-free windows of the same shape.

    rotation: see rotation_loss; pace: the same for steps between poses, 0 for a window of one; speed: of the
    mean size of those steps; unit_norm: squared; position: mean distance in metres; squared:
    of the components, summed over a joint. speed and squared are left out where they have no weight.
    """
    made = rotation.normalize(raw)
    norms = raw.square().sum(-1)
    moments = torch.randint(raw.shape[1], (POSITION_POSES,), device=raw.device)
    here, there = body(torch.cat([made[:, moments], windows[:, moments]])).chunk(2)
    distance = (here - there).square().sum(-1)
    steps, wanted = (each[:, 1:] - each[:, :-1] for each in (made, windows))
    parts = {
        "rotation": rotation_loss(raw, windows),
        "pace": 2 * _length(steps - wanted) if steps.numel() else raw.new_zeros(()),
        "unit_norm": (norms - 1).square().mean(),
        "position": (distance + 1e-8).sqrt().mean(),
    }
    if weights.speed:
        parts["speed"] = _mean_size_loss(steps, wanted)
    if weights.squared:
        parts["squared"] = (raw - windows).square().sum(-1).mean()
    return parts


def divergence(mean: Tensor, log_variance: Tensor) -> Tensor:
    """Nats by which Gaussians (B, Z) differ from a standard one, mean of a batch."""
    return 0.5 * (mean.square() + log_variance.exp() - 1 - log_variance).sum(-1).mean()


def sampled(mean: Tensor, log_variance: Tensor) -> Tensor:
    """A sample of each Gaussian (B, Z)."""
    return mean + torch.exp(0.5 * log_variance) * torch.randn_like(mean)


def prior_loss(critic: PriorCritic, latents: Tensor) -> Tensor:
    """The encoder's loss: how well the critic tells its latents from the prior. Has a gradient."""
    logits = critic(latents)
    return functional.binary_cross_entropy_with_logits(logits, torch.ones_like(logits))


def critic_loss(critic: PriorCritic, latents: Tensor, noise: Tensor, steepness: float = 1.0) -> Tensor:
    """The critic's loss for confusing latents (detached here) with samples of the prior.

    steepness: weight of a penalty on its slope at the prior's samples (R1, Mescheder et al. 2018). Without it
    the critic grows ever steeper, always wins, and drags the latents around instead of shaping them.
    """
    noise = noise.detach().requires_grad_()
    made, true = critic(latents.detach()), critic(noise)
    (slope,) = torch.autograd.grad(true.sum(), noise, create_graph=True)
    return (
        0.5 * functional.binary_cross_entropy_with_logits(true, torch.ones_like(true))
        + 0.5 * functional.binary_cross_entropy_with_logits(made, torch.zeros_like(made))
        + 0.5 * steepness * slope.square().sum(-1).mean()
    )


def rotation_loss(raw: Tensor, windows: Tensor) -> Tensor:
    """Mean joint angle error in radians (the chord, twice: exact to 1 % below 25 degrees)."""
    return 2 * _length(rotation.normalize(raw) - windows)


def _mean_size_loss(changes: Tensor, wanted: Tensor) -> Tensor:
    """In radians: how far each joint's mean change is from the wanted one's."""
    sizes, sizes_wanted = (_sizes(each).mean((0, 1)) for each in (changes, wanted))
    return 2 * (sizes - sizes_wanted).abs().mean()


def _length(differences: Tensor) -> Tensor:
    return _sizes(differences).mean()


def _sizes(differences: Tensor) -> Tensor:
    return (differences.square().sum(-1) + 1e-8).sqrt()
