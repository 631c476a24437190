"""The improviser: an LSTM with a mixture density head that continues a dance, move after move, by sampling.

The network of the 'mixture density' dance models (Pettee et al., 'Beyond Imitation'), one level up: it does
not sample the next pose, in which every number would tremble on its own (17 % of the power above 8 Hz;
dancers: 1 %), but the code of the next move (moves.py). It always samples, with a seed and a temperature: the
mixture's mean, which the published notebook uses instead, is the same dance every night.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from appliance.dancer.material.improvising import (
    BEFORE,
    FARTHEST,
    NARROWEST,
    WIDEST,
    Numbers,
    drawn,
    improvised,
)
from appliance.studio.improviser.moves import Moves, MovesShape, Scale


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

    def sample(self, temperature: float, rng: np.random.Generator) -> Tensor:
        """Samples (B, D); temperature 1: as learned, 0: the mean of the likeliest Gaussian."""
        logits, means, log_scales = (part.numpy() for part in (self.logits, self.means, self.log_scales))
        return torch.from_numpy(drawn(logits, means, log_scales, temperature, rng))


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
        numbers, remembered = self.numbers(before, code, state, dropout)
        return Mixture.of(numbers, self.mixtures), remembered

    def numbers(
        self, before: Tensor, code: Tensor, state: State, dropout: float = 0.0
    ) -> tuple[Tensor, State]:
        """The same; the distribution as the numbers of a Mixture, (B, K * (2 code + 1))."""
        hidden = functional.elu(self.seen(torch.cat([before.flatten(1), code], -1)))
        remembered = []
        for cell, earlier in zip(self.cells, state, strict=True):
            h, c = cell(functional.dropout(hidden, dropout, training=dropout > 0), earlier)
            remembered.append((h, c))
            hidden = hidden + h
        out: Tensor = self.head(functional.dropout(hidden, dropout, training=dropout > 0))
        return out, remembered


class Improviser(nn.Module):
    """Scale, moves and choreographer: all that continues a dance."""

    def __init__(self, shape: MovesShape, width: int, layers: int, mixtures: int) -> None:
        super().__init__()
        self.shape = shape
        self.scale = Scale(shape)
        self.moves = Moves(shape)
        self.choreographer = Choreographer(shape, width, layers, mixtures)

    def improvise(self, primer: Tensor, moves: int, temperature: float, seed: int) -> Tensor:
        """Continue a primer (B, T, features), at least 3 + 8 steps, by (B, 8 * moves, features)."""
        return torch.from_numpy(improvised(Networks(self), primer.numpy(), moves, temperature, seed))


class Networks:
    """An improviser as `improvised` asks for its networks."""

    def __init__(self, improviser: Improviser) -> None:
        self._parts, choreographer = improviser, improviser.choreographer
        self.mixtures, self._layers = choreographer.mixtures, len(choreographer.cells)
        self.cells = 2 * self._layers * choreographer.width

    @torch.no_grad()
    def code_of(self, before: Numbers, move: Numbers) -> Numbers:
        """See Choreographer."""
        code: Numbers = self._parts.moves.encode(self._inside(before), self._inside(move))[0].numpy()
        return code

    @torch.no_grad()
    def forecast(self, before: Numbers, code: Numbers, cells: Numbers) -> tuple[Numbers, Numbers]:
        """See Choreographer."""
        parts = torch.from_numpy(cells).chunk(2 * self._layers, dim=1)
        state = list(zip(parts[::2], parts[1::2], strict=True))
        numbers, state = self._parts.choreographer.numbers(
            self._inside(before), torch.from_numpy(code), state
        )
        return numbers.numpy(), torch.cat([part for pair in state for part in pair], 1).numpy()

    @torch.no_grad()
    def move_of(self, before: Numbers, code: Numbers) -> Numbers:
        """See Choreographer."""
        move = self._parts.moves.decode(self._inside(before), torch.from_numpy(code))
        made: Numbers = self._parts.scale.features(move.clamp(-FARTHEST, FARTHEST)).numpy()
        return made

    def _inside(self, features: Numbers) -> Tensor:
        return self._parts.scale.inside(torch.from_numpy(features))
