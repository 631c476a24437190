"""Improvising: a dance continued move after move; each move's code is drawn from a mixture of Gaussians.

The box and the studio draw alike: with numpy's generator, from whatever computes the networks.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

MOVE = 8  # steps of a move, 0.64 s
BEFORE = 3  # steps before it that the networks see
NARROWEST = math.log(0.1)  # log scale; a narrower Gaussian memorises takes
WIDEST = math.log(2.0)
FARTHEST = 6.0  # deviations of each number of a step: recorded steps are hardly ever further from the mean

Numbers = NDArray[np.float32]


class Choreographer(Protocol):
    """The networks that continue a dance; steps are features (B, T, F), see steps.Steps.

    mixtures: Gaussians of a forecast; cells: numbers of its memory, 0 before the first move.
    """

    mixtures: int
    cells: int

    def code_of(self, before: Numbers, move: Numbers) -> Numbers:
        """The code (B, C) of a move (B, 8, F) after the steps before it (B, 3, F)."""

    def forecast(self, before: Numbers, code: Numbers, cells: Numbers) -> tuple[Numbers, Numbers]:
        """After a move's last steps and its code: the next code's mixture (B, K * (2 C + 1)), and memory."""

    def move_of(self, before: Numbers, code: Numbers) -> Numbers:
        """The move (B, 8, F) that continues the steps before it (B, 3, F)."""


def improvised(networks: Choreographer, heard: Numbers, moves: int, temperature: float, seed: int) -> Numbers:
    """Continue steps (B, T, F), at least 3 + 8, by (B, 8 * moves, F). Raises ValueError for fewer."""
    known = (heard.shape[1] - BEFORE) // MOVE
    if known < 1:
        raise ValueError(f"{heard.shape[1]} steps were heard; it takes {BEFORE + MOVE} to continue from.")
    cells = np.zeros((len(heard), networks.cells), np.float32)
    for at in range(heard.shape[1] - known * MOVE, heard.shape[1], MOVE):
        code = networks.code_of(heard[:, at - BEFORE : at], heard[:, at : at + MOVE])
        before = heard[:, at + MOVE - BEFORE : at + MOVE]
        mixture, cells = networks.forecast(before, code, cells)
    rng, danced = np.random.default_rng(seed), []
    for _ in range(moves):
        code = drawn(*parts_of(mixture, networks.mixtures), temperature, rng)
        danced.append(networks.move_of(before, code))
        before = danced[-1][:, -BEFORE:]
        mixture, cells = networks.forecast(before, code, cells)
    return np.concatenate(danced, axis=1)


def parts_of(mixture: Numbers, mixtures: int) -> tuple[Numbers, Numbers, Numbers]:
    """A mixture's numbers (B, K * (2 D + 1)) -> logits (B, K), means and log scales (B, K, D)."""
    means, log_scales = np.moveaxis(mixture[:, mixtures:].reshape(len(mixture), 2, mixtures, -1), 1, 0)
    return mixture[:, :mixtures], means, np.clip(log_scales, NARROWEST, WIDEST)


def drawn(
    logits: Numbers, means: Numbers, log_scales: Numbers, temperature: float, rng: np.random.Generator
) -> Numbers:
    """Samples (B, D); temperature 1: as learned, 0: the mean of the likeliest Gaussian."""
    chosen = (logits + temperature * rng.gumbel(size=logits.shape)).argmax(axis=1)
    rows = np.arange(len(logits))
    noise = rng.standard_normal(means[:, 0].shape)
    sample: Numbers = means[rows, chosen] + temperature * np.exp(log_scales[rows, chosen]) * noise
    return sample.astype(np.float32)
