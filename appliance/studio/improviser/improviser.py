"""The improviser: an LSTM with a mixture density head that continues a dance, move after move, by sampling.

The network of the 'mixture density' dance models (Pettee et al., 'Beyond Imitation'), one level up: it does
not sample the next pose, in which every number would tremble on its own (17 % of the power above 8 Hz;
dancers: 1 %), but the code of the next move (moves.py). It always samples, with a seed and a temperature: the
mixture's mean, which the published notebook uses instead, is the same dance every night.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from appliance.studio.improviser.moves import BEFORE, MOVE, Moves, MovesShape, Scale

NARROWEST = math.log(0.1)  # log scale; a narrower Gaussian memorises takes
WIDEST = math.log(2.0)
FARTHEST = 6.0  # deviations of each number of a step: recorded steps are hardly ever further from the mean


@dataclass
class Mixture:
    """Gaussians with diagonal spread: logits (B, K); means and log_scales (B, K, D)."""

    logits: Tensor
    means: Tensor
    log_scales: Tensor

    @staticmethod
    def of(numbers: Tensor, mixtures: int, narrowest: float = NARROWEST) -> Mixture:
        """A network's output (B, K * (2 D + 1)) as K Gaussians; none has a log scale below `narrowest`."""
        means, log_scales = numbers[:, mixtures:].reshape(len(numbers), 2, mixtures, -1).unbind(1)
        return Mixture(numbers[:, :mixtures], means, log_scales.clamp(narrowest, WIDEST))

    def negative_log_likelihood(self, x: Tensor) -> Tensor:
        """(B,) nats a number of x (B, D)."""
        off = (x[:, None] - self.means) * torch.exp(-self.log_scales)
        each = -(0.5 * off.square() + self.log_scales + 0.5 * math.log(2 * math.pi)).sum(-1)
        joined = torch.logsumexp(functional.log_softmax(self.logits, -1) + each, -1)
        return -joined / x.shape[-1]

    def sample(self, temperature: float, generator: torch.Generator | None = None) -> Tensor:
        """Samples (B, D); temperature 1: as learned, 0: the mean of the likeliest Gaussian."""
        uniform = torch.rand(self.logits.shape, generator=generator).clamp(1e-9, 1 - 1e-7)
        gumbel = -torch.log(-torch.log(uniform))
        rows = torch.arange(len(self.logits))
        chosen = (self.logits + temperature * gumbel).argmax(-1)
        noise = torch.randn(self.means[:, 0].shape, generator=generator)
        return self.means[rows, chosen] + temperature * torch.exp(self.log_scales[rows, chosen]) * noise


State = list[tuple[Tensor, Tensor]]


class Choreographer(nn.Module):
    """Maps the last steps and the last move's code to the distribution of the next move's code."""

    def __init__(self, shape: MovesShape, width: int, layers: int, mixtures: int) -> None:
        super().__init__()
        self.width, self.mixtures = width, mixtures
        self.seen = nn.Linear(BEFORE * shape.inside + shape.code, width)
        self.cells = nn.ModuleList([nn.LSTMCell(width, width) for _ in range(layers)])
        self.head = nn.Linear(width, mixtures * (2 * shape.code + 1))
        self.head.weight.data *= 0.3

    def start(self, batch: int) -> State:
        """The memory before the first move."""
        empty = torch.zeros(batch, self.width)
        return [(empty, empty) for _ in self.cells]

    def forward(
        self, before: Tensor, code: Tensor, state: State, dropout: float = 0.0
    ) -> tuple[Mixture, State]:
        """before (B, 3, inside), the last move's code (B, code) -> the next code's distribution, memory."""
        hidden = functional.elu(self.seen(torch.cat([before.flatten(1), code], -1)))
        remembered = []
        for cell, earlier in zip(self.cells, state, strict=True):
            h, c = cell(functional.dropout(hidden, dropout, training=dropout > 0), earlier)
            remembered.append((h, c))
            hidden = hidden + h
        out = self.head(functional.dropout(hidden, dropout, training=dropout > 0))
        return Mixture.of(out, self.mixtures), remembered


class Improviser(nn.Module):
    """Scale, moves and choreographer: all that continues a dance."""

    def __init__(self, shape: MovesShape, width: int, layers: int, mixtures: int) -> None:
        super().__init__()
        self.shape = shape
        self.scale = Scale(shape)
        self.moves = Moves(shape)
        self.choreographer = Choreographer(shape, width, layers, mixtures)

    @torch.no_grad()
    def improvise(self, primer: Tensor, moves: int, temperature: float, seed: int) -> Tensor:
        """Continue a primer (B, T, features), at least 3 + 8 steps, by (B, 8 * moves, features)."""
        generator = torch.Generator().manual_seed(seed)
        x = self.scale.inside(primer)
        state = self.choreographer.start(len(x))
        known = (x.shape[1] - BEFORE) // MOVE
        if not known:
            raise ValueError(f"The primer has {x.shape[1]} steps; it takes {BEFORE + MOVE} to continue from.")
        for number in range(known):
            at = x.shape[1] - (known - number) * MOVE
            code, _ = self.moves.encode(x[:, at - BEFORE : at], x[:, at : at + MOVE])
            before = x[:, at + MOVE - BEFORE : at + MOVE]
            mixture, state = self.choreographer(before, code, state)
        danced = []
        for _ in range(moves):
            code = mixture.sample(temperature, generator)
            danced.append(self.moves.decode(before, code).clamp(-FARTHEST, FARTHEST))
            before = danced[-1][:, -BEFORE:]
            mixture, state = self.choreographer(before, code, state)
        return self.scale.features(torch.cat(danced, 1))
