"""Strings: a network of coupled springs, rendered mode by mode."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose.skeleton import Skeleton
from appliance.show.sound import BOWED_SAMPLES, StringsConfig
from appliance.show.string_pitches import decays, string_pitches

Samples = NDArray[np.floating[Any]]

STEP = BOWED_SAMPLES
_HIGHEST = 0.45  # fraction of the sample rate


class Strings:
    """B strings of P partials each: the modes of a linear network, every one advanced exactly.

    The strings' p-th partials are masses on springs of (2 pi p f)^2 each, tied to those of the bones that
    they meet by a coupling; the network's modes are the eigenvectors. A mode is a complex number that turns
    and decays; every STEP samples the dance pushes its velocity, so that the sound itself never jumps.

    bones (B, 2): joints from and to; hertz (B,): pitches; place (B,): angle around the stage, radians.
    """

    def __init__(self, skeleton: Skeleton, config: StringsConfig, rate: int, seed: int = 0) -> None:
        self.bones, self.hertz = string_pitches(skeleton, config.base_hz)
        count = len(self.bones)
        self.places: Samples = np.arange(count) * (2 * np.pi / max(count, 1))
        self._random = np.random.default_rng(seed)
        meet = (self.bones[:, None, :, None] == self.bones[None, :, None, :]).any(axis=(2, 3))
        frequencies, shares, gains = [], [], []
        for partial in range(1, config.partials + 1):
            stiffness = np.diag((2 * np.pi * partial * self.hertz) ** 2)
            ties = config.coupling * np.sqrt(np.outer(np.diag(stiffness), np.diag(stiffness))) * meet
            np.fill_diagonal(ties, 0.0)
            squares, vectors = np.linalg.eigh(stiffness + np.diag(ties.sum(axis=1)) - ties)
            frequencies.append(np.sqrt(np.maximum(squares, 1.0)))
            shares.append(vectors)
            gains.append(np.full(count, config.brightness ** (partial - 1)))
        turning = np.concatenate(frequencies)
        audible = turning < 2 * np.pi * _HIGHEST * rate
        decay = decays(turning, turning.min(), config.decay_s)
        poles = (-decay + 1j * turning) / rate
        self.frequencies = turning / (2 * np.pi)
        self._from_strings = np.concatenate(shares, axis=1) * np.concatenate(gains) * audible
        self._to_strings = np.concatenate(shares, axis=1)
        self._state = np.zeros(len(turning), complex)
        self._ahead = np.exp(poles * STEP)
        self._ringing = np.exp(np.outer(poles, np.arange(STEP)))
        self._loudness = config.volume * np.sqrt(decay / rate * STEP)

    def still(self) -> None:
        """Stop all strings at once."""
        self._state[:] = 0.0

    def render(self, drive: Samples, pan: Samples) -> Samples:
        """The next samples (steps x STEP, channels): drive (steps, B) is how strongly each string is bowed,
        0..1; pan (B, channels) how loud it is on each loudspeaker.
        """
        steps = len(drive)
        pushes = self._random.choice((-1.0, 1.0), drive.shape) * drive
        pushes = (pushes @ self._from_strings) * self._loudness
        states = np.empty((steps, len(self._state)), complex)
        for step in range(steps):
            states[step] = self._state = self._state + 1j * pushes[step]
            self._state = self._state * self._ahead
        weights = pan.T @ self._to_strings
        sounds = (weights[:, None, :] * states).reshape(-1, states.shape[1]) @ self._ringing
        sound: Samples = sounds.real.reshape(len(weights), -1).T
        return sound


def around(places: Samples, channels: int) -> Samples:
    """(B, channels): equal power between the two nearest of a ring of loudspeakers; a pair: left to right."""
    if channels == 2:
        angle = (1.0 + np.sin(places)) * np.pi / 4
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    apart = places[:, None] - np.arange(channels) * (2 * np.pi / channels)
    apart = np.abs((apart + np.pi) % (2 * np.pi) - np.pi)
    gains: Samples = np.cos(np.minimum(apart * channels / 4, np.pi / 2))
    return gains
