"""Paths through the latents of the autoencoder: sampled, walked, or between two excerpts; each one a cycle.

A path has one latent for each window, (W, Z). The last window leads into the first, so that what is decoded
is a phrase without an end. The prior is a standard Gaussian; `spread` is in its standard deviations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Latents = NDArray[np.float32]


def sampled(windows: int, latent: int, spread: float, seed: int) -> Latents:
    """The paper's way: every window is an independent sample; blending decides how smooth it gets."""
    rng = np.random.default_rng(seed)
    return (spread * rng.standard_normal((windows, latent))).astype(np.float32)


def walked(windows: int, latent: int, spread: float, waves: float, seed: int) -> Latents:
    """A smooth random walk: of each number of the latent the mean square is spread^2.

    waves: how often a number goes back and forth on the whole way, at most: terms of a Fourier series.
    """
    rng = np.random.default_rng(seed)
    terms = max(1, min(round(waves), windows // 2))
    amounts = np.zeros((windows // 2 + 1, latent), dtype=complex)
    amounts[1 : terms + 1] = rng.standard_normal((terms, latent)) + 1j * rng.standard_normal((terms, latent))
    path = np.fft.irfft(amounts, windows, axis=0)
    size = np.sqrt((path**2).mean(axis=0))
    walk: Latents = (spread * path / np.maximum(size, 1e-12)).astype(np.float32)
    return walk


def between(one: Latents, other: Latents, mix: float, offset: float, seed: int) -> Latents:
    """Two excerpts' latents (W, Z), mixed (0: one, 1: other) and moved by `offset` standard deviations.

    The direction of the offset is the seed's. A mean of independent latents is shorter than both; the mixture
    has the length that the prior expects, or the dance would shrink towards the mean pose half way.
    """
    away = np.random.default_rng(seed).standard_normal(one.shape[1])
    mixed = (1 - mix) * one + mix * other
    wanted = (1 - mix) * np.linalg.norm(one, axis=1) + mix * np.linalg.norm(other, axis=1)
    mixed *= (wanted / np.maximum(np.linalg.norm(mixed, axis=1), 1e-12))[:, None]
    moved: Latents = (mixed + offset * away).astype(np.float32)
    return moved
