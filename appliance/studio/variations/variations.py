"""Variations: a phrase's latents moved, mixed with another's, or sampled, and decoded into motion.

A phrase longer than the model's window is covered by overlapping windows, all moved by the same noise, and
blended by Hann weights and by how certain the network is of each rotation: in a fast spin windows contradict
each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from appliance.dancer.material import latent_paths
from appliance.dancer.material.cyclic import Starts, hann_mean
from appliance.dancer.material.latent_paths import Latents
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.coded_windows import decoded, encoded, latent_of, window_of
from appliance.studio.evaluation.coders import Poses
from appliance.studio.studio_error import StudioError

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network

OVERLAP = 4  # windows that know a pose


@dataclass(frozen=True)
class EncodedPhrase:
    """A phrase as latents (W, Z) and headings (W, 4) of its windows; ticks: poses that they cover."""

    latents: Latents
    facing: Array
    ticks: int


def encode_phrase(network: Network, poses: Array) -> EncodedPhrase:
    """Poses (T, M, 4) of the moving joints at 50 Hz. Raises StudioError for fewer than a window has."""
    length = window_of(network)
    if len(poses) < length:
        raise StudioError(
            f"The phrase has {len(poses)} poses; the model sees {length} at once ({length / 50:.2f} s). "
            "Give a longer one, or begin earlier."
        )
    hop = hop_of(network)
    starts = np.arange(0, len(poses) - length + 1, hop)
    whole = quaternion.continuous(poses).astype(np.float32)
    latents, facing = encoded(network, whole[starts[:, None] + np.arange(length)])
    return EncodedPhrase(latents, facing, int(starts[-1]) + length)


def varied(network: Network, phrase: EncodedPhrase, sigma: float, seed: int) -> Poses:
    """The phrase moved by noise of `sigma` standard deviations of the prior; 0: as the model knows it."""
    noise = np.random.default_rng(seed).standard_normal(phrase.latents.shape[1])
    return _danced(network, phrase, phrase.latents + np.asarray(sigma * noise, dtype=np.float32))


def mixed(network: Network, phrase: EncodedPhrase, other: EncodedPhrase, share: float, seed: int) -> Poses:
    """The phrase with a share of another one, as long as the shorter of them."""
    count = min(len(phrase.latents), len(other.latents))
    path = latent_paths.between(phrase.latents[:count], other.latents[:count], share, 0.0, seed)
    return _danced(network, phrase, path)


def sampled(network: Network, spread: float, seed: int) -> Poses:
    """One window out of the prior, facing ahead."""
    made: Poses = decoded(network, latent_paths.sampled(1, latent_of(network), spread, seed))[0]
    return made


def hop_of(network: Network) -> int:
    """Ticks from one window to the next."""
    return max(1, window_of(network) // OVERLAP)


def _danced(network: Network, phrase: EncodedPhrase, path: Latents) -> Poses:
    hop = hop_of(network)
    windows = decoded(network, path, phrase.facing[: len(path)], is_raw=True)
    starts, ticks = np.arange(len(windows)) * hop, (len(windows) - 1) * hop + windows.shape[1]
    return hann_mean(aligned_windows(quaternion.continuous(windows, axis=1), starts, ticks), starts, ticks)


def aligned_windows(windows: Array, starts: Starts, ticks: int) -> Poses:
    """Windows (W, T, M, 4) at these starts, each joint's sign as in those before, where they overlap."""
    total = np.zeros((ticks, *windows.shape[2:]))
    for window, start in zip(windows, starts, strict=True):
        before = total[start : start + len(window)]
        window[:, np.sum(before * window, axis=(0, -1)) < 0] *= -1
        before += window
    return windows.astype(np.float32)
