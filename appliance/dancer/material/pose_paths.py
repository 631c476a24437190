"""Paths through the poses of a pose autoencoder: a phrase's own path that wobbles, and a drawn line."""

from __future__ import annotations

import numpy as np

from appliance.dancer.material.latent_paths import Latents
from appliance.pose.quaternion import Array


def wobbled(latents: Latents, amplitude: float, frequency: float, seed: int, fps: float = 50.0) -> Latents:
    """The path with a sinusoid on each number of the latent.

    amplitude: in standard deviations of the prior, of each number; frequency in Hz; the phases are the
    seed's.
    """
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, latents.shape[1])
    angles = 2 * np.pi * frequency * np.arange(len(latents))[:, None] / fps + phases
    moved: Latents = (latents + amplitude * np.sin(angles)).astype(np.float32)
    return moved


def even_path(points: Array, ticks: int) -> Array:
    """A drawn line (N, D) -> (ticks, D): at an even speed, its corners rounded over 0.2 s."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, lengths[-1], ticks)
    walked = np.stack([np.interp(at, lengths, column) for column in points.T], axis=1)
    weights = np.hanning(11 + 2)[1:-1]
    padded = np.pad(walked, ((5, 5), (0, 0)), mode="edge")
    smooth = [np.convolve(column, weights / weights.sum(), "valid") for column in padded.T]
    return np.stack(smooth, axis=1)
