"""Moves: two thirds of a second of dance at once, from the steps before it and a code.

A conditional variational autoencoder in the manner of 'Character Controllers Using Motion VAEs' (Ling et al.
2020), over moves of 8 steps: any sampled code gives one smooth move that continues the steps before it. The
improviser's mixtures learn the distribution of the codes of recorded moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from appliance.dancer.material.improvising import BEFORE, MOVE

PLACE_WEIGHT = 3.0  # weight of the root's displacement in the loss, relative to a latent direction


@dataclass(frozen=True)
class StepShape:
    """latent: numbers of a pose (an autoencoder's latent, or its quaternions); kept: how many of their
    principal directions are used; ways: numbers of the root's displacement.
    """

    latent: int
    kept: int
    ways: int

    @property
    def features(self) -> int:
        return self.latent + self.ways

    @property
    def inside(self) -> int:
        return self.kept + self.ways


@dataclass(frozen=True)
class MovesShape(StepShape):
    """code: size of a move's code; width and depth of the dense networks."""

    code: int = 32
    width: int = 512
    depth: int = 2


class Scale(nn.Module):
    """Maps steps to and from principal directions of latents and the root's displacement, standardised."""

    def __init__(self, shape: StepShape) -> None:
        super().__init__()
        self.shape = shape
        self.middle: Tensor
        self.inward: Tensor
        self.outward: Tensor
        self.importance: Tensor
        self.register_buffer("middle", torch.zeros(shape.features))
        self.register_buffer("inward", torch.zeros(shape.features, shape.inside))
        self.register_buffer("outward", torch.zeros(shape.inside, shape.features))
        self.register_buffer("importance", torch.ones(shape.inside))

    def learn(self, features: Tensor) -> None:
        """Set directions and scales from training steps (N, features).

        importance (inside,): mean 1; a direction weighs as much as it varies in the autoencoder's latent.
        """
        shape = self.shape
        self.middle.copy_(features.mean(0))
        centred = features - self.middle
        latents = centred[:, : shape.latent]
        variances, directions = torch.linalg.eigh(latents.T @ latents / len(latents))
        directions = directions.flip(-1)[:, : shape.kept]
        scale = torch.cat([(latents @ directions).std(0), centred[:, shape.latent :].std(0)]).clamp_min(1e-5)
        basis = torch.zeros(shape.features, shape.inside)
        basis[: shape.latent, : shape.kept] = directions
        basis[shape.latent :, shape.kept :] = torch.eye(shape.ways)
        self.inward.copy_(basis / scale)
        self.outward.copy_((basis * scale).T)
        importance = variances.flip(-1)[: shape.kept].clamp_min(1e-5)
        importance = torch.cat(
            [importance, torch.full((shape.ways,), PLACE_WEIGHT * float(importance.mean()))]
        )
        self.importance.copy_(importance / importance.mean())

    def inside(self, features: Tensor) -> Tensor:
        """(..., features) -> (..., inside)."""
        return (features - self.middle) @ self.inward

    def features(self, inside: Tensor) -> Tensor:
        """(..., inside) -> (..., features)."""
        return inside @ self.outward + self.middle


class Dense(nn.Module):
    """Residual dense layers; each receives the code, so that none forgets it."""

    def __init__(self, size_in: int, code: int, size_out: int, width: int, depth: int) -> None:
        super().__init__()
        self.first = nn.Linear(size_in + code, width)
        self.norms = nn.ModuleList([nn.LayerNorm(width) for _ in range(depth)])
        self.layers = nn.ModuleList([nn.Linear(width + code, width) for _ in range(depth)])
        self.last_norm, self.last = nn.LayerNorm(width), nn.Linear(width, size_out)
        self.last.weight.data *= 0.2

    def forward(self, x: Tensor, code: Tensor | None = None) -> Tensor:
        def with_code(h: Tensor) -> Tensor:
            return h if code is None else torch.cat([h, code], -1)

        h = self.first(with_code(x))
        for norm, layer in zip(self.norms, self.layers, strict=True):
            h = h + layer(with_code(nn.functional.elu(norm(h))))
        out: Tensor = self.last(nn.functional.elu(self.last_norm(h)))
        return out


class Moves(nn.Module):
    """before (B, 3, inside) and a move (B, 8, inside) -> its code; before and a code -> the move."""

    def __init__(self, shape: MovesShape) -> None:
        super().__init__()
        self.shape = shape
        seen, made = BEFORE * shape.inside, MOVE * shape.inside
        self.encoder = Dense(seen + made, 0, 2 * shape.code, shape.width, 1)
        self.decoder = Dense(seen, shape.code, made, shape.width, shape.depth)

    def encode(self, before: Tensor, move: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and log variance (B, code) of the code."""
        relative = move - before[:, -1:]
        out: Tensor = self.encoder(torch.cat([before.flatten(1), relative.flatten(1)], -1))
        mean, log_variance = out.chunk(2, -1)
        return mean, log_variance.clamp(-8.0, 2.0)

    def decode(self, before: Tensor, code: Tensor) -> Tensor:
        """The move (B, 8, inside) that continues `before`."""
        flat: Tensor = self.decoder(before.flatten(1), code)
        return before[:, -1:] + flat.reshape(-1, MOVE, self.shape.inside)


def move_loss(made: Tensor, move: Tensor, before: Tensor, importance: Tensor) -> Tensor:
    """Weighted squared error of the steps and of their pace, a number of a step."""

    def pace(steps: Tensor) -> Tensor:
        return steps - torch.cat([before[:, -1:], steps[:, :-1]], 1)

    error = (made - move).square() + 2.0 * (pace(made) - pace(move)).square()
    loss: Tensor = (error * importance).mean()
    return loss
