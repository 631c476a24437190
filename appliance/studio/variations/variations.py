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
from appliance.dancer.material.put_on import put_on
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
    """A phrase as latents (W, Z) and headings (W, 4) of its windows; poses (T, M, 4): those that they cover,
    without sign jumps; known (T, M, 4): the same as the network decodes them, blurred.
    """

    latents: Latents
    facing: Array
    poses: Poses
    known: Poses

    @property
    def ticks(self) -> int:
        return len(self.poses)


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
    known = _danced(network, latents, facing)
    return EncodedPhrase(latents, facing, whole[: len(known)], known)


def varied(network: Network, phrase: EncodedPhrase, sigma: float, seed: int) -> Poses:
    """The phrase moved by noise of `sigma` standard deviations of the prior; 0: the phrase as it is.

    Only what the noise changes in the network's motion is put on the phrase: what the network does not know
    of the phrase stays in it.
    """
    noise = np.random.default_rng(seed).standard_normal(phrase.latents.shape[1])
    moved = phrase.latents + np.asarray(sigma * noise, dtype=np.float32)
    return put_on(phrase.poses, phrase.known, _danced(network, moved, phrase.facing))


def mixed(network: Network, phrase: EncodedPhrase, other: EncodedPhrase, share: float, seed: int) -> Poses:
    """The phrase with a share of another one, as long as the shorter of them."""
    count = min(len(phrase.latents), len(other.latents))
    path = latent_paths.between(phrase.latents[:count], other.latents[:count], share, 0.0, seed)
    return _danced(network, path, phrase.facing[:count])


def sampled(network: Network, spread: float, seed: int) -> Poses:
    """One window out of the prior, facing ahead."""
    made: Poses = decoded(network, latent_paths.sampled(1, latent_of(network), spread, seed))[0]
    return made


def hop_of(network: Network) -> int:
    """Ticks from one window to the next."""
    return max(1, window_of(network) // OVERLAP)


def _danced(network: Network, path: Latents, facing: Array) -> Poses:
    hop = hop_of(network)
    windows = decoded(network, path, facing, is_raw=True)
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
