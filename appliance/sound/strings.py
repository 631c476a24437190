"""Strings: a network of coupled springs, rendered mode by mode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.pose.skeleton import Skeleton
from appliance.show.sound import BOWED_SAMPLES, StringsConfig
from appliance.show.string_pitches import PENTATONIC, decays, string_pitches

Samples = NDArray[np.floating[Any]]

STEP = BOWED_SAMPLES
_SILENT = 1e-5
_HIGHEST = 0.45  # fraction of the sample rate
_BAR = (1.0, 2.756, 5.404, 8.933, 13.344, 18.638)  # partials of a bar with free ends (Fletcher and Rossing)
_MOUTH = ((650.0, 80.0), (1080.0, 90.0), (2650.0, 120.0))  # formants of a sung "a": hertz, width (Fant 1960)


class Preset(NamedTuple):
    """bow, strike: how loud; decay: factor on the show's; ratios: of the partials, () harmonic."""

    bow: float
    strike: float
    decay: float = 1.0
    ratios: tuple[float, ...] = ()
    formants: tuple[tuple[float, float], ...] = ()


PRESETS = {
    "strings": Preset(1.0, 1.0),
    "voices": Preset(1.6, 0.3, 0.5, formants=_MOUTH),
    "percussion": Preset(0.05, 2.0, 0.25, ratios=_BAR),
}


class Strings:
    """B strings of P partials each: the modes of a linear network, every one advanced exactly.

    The strings' p-th partials are masses on springs of (2 pi p f)^2 each, tied to those of the bones that
    they meet by a coupling; the network's modes are the eigenvectors. A mode is a complex number that turns
    and decays; every STEP samples the dance pushes its velocity, so that the sound itself never jumps.

    bones (B, 2): joints from and to; hertz (B,): pitches; place (B,): angle around the stage, radians.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        config: StringsConfig,
        rate: int,
        seed: int = 0,
        scale: Sequence[int] = PENTATONIC,
    ) -> None:
        preset = PRESETS[config.preset]
        self.bones, self.hertz = string_pitches(skeleton, config.base_hz, scale)
        count = len(self.bones)
        self.places: Samples = np.arange(count) * (2 * np.pi / max(count, 1))
        self._random = np.random.default_rng(seed)
        meet = (self.bones[:, None, :, None] == self.bones[None, :, None, :]).any(axis=(2, 3))
        frequencies, shares, gains = [], [], []
        partials = preset.ratios[: config.partials] or range(1, config.partials + 1)
        for number, partial in enumerate(partials):
            stiffness = np.diag((2 * np.pi * partial * self.hertz) ** 2)
            ties = config.coupling * np.sqrt(np.outer(np.diag(stiffness), np.diag(stiffness))) * meet
            np.fill_diagonal(ties, 0.0)
            squares, vectors = np.linalg.eigh(stiffness + np.diag(ties.sum(axis=1)) - ties)
            frequencies.append(np.sqrt(np.maximum(squares, 1.0)))
            shares.append(vectors)
            gains.append(_formed(partial * self.hertz, preset.formants) * config.brightness**number)
        turning = np.concatenate(frequencies)
        audible = turning < 2 * np.pi * _HIGHEST * rate
        decay = decays(turning, turning.min(initial=np.inf), config.decay_s * preset.decay)
        poles = (-decay + 1j * turning) / rate
        self.frequencies = turning / (2 * np.pi)
        self._from_strings = np.concatenate(shares, axis=1) * np.concatenate(gains) * audible
        self._to_strings = np.concatenate(shares, axis=1)
        self._state = np.zeros(len(turning), complex)
        self._ahead = np.exp(poles * STEP)
        self._ringing = np.exp(np.outer(poles, np.arange(STEP)))
        self._loudness = preset.bow * config.volume * np.sqrt(decay / rate * STEP)
        self._strike = preset.strike * config.attacks * config.volume

    def still(self) -> None:
        """Stop all strings at once."""
        self._state[:] = 0.0

    @property
    def rings(self) -> bool:
        """Whether they are audible."""
        return float(np.abs(self._state).max(initial=0.0)) > _SILENT

    def strike(self, strength: Samples) -> None:
        """Strike strings once, each as strongly as (B,) says, 0..1."""
        self._state = self._state + 1j * self._strike * (strength @ self._from_strings)

    def render(self, drive: Samples, pan: Samples, loud: Samples | None = None) -> Samples:
        """The next samples (steps x STEP, channels): drive (steps, B) is how strongly each string is bowed,
        0..1; pan (B, channels) how loud it is on each loudspeaker; loud (steps + 1, B): a factor on that at
        the start of each step and at the end of the last, evenly between; None: 1.
        """
        steps = len(drive)
        pushes = self._random.choice((-1.0, 1.0), drive.shape) * drive
        pushes = (pushes @ self._from_strings) * self._loudness
        states = np.empty((steps, len(self._state)), complex)
        for step in range(steps):
            states[step] = self._state = self._state + 1j * pushes[step]
            self._state = self._state * self._ahead
        if loud is None:
            weights = (pan.T @ self._to_strings)[:, None, :]
            return self._sounding(weights * states).reshape(pan.shape[1], -1).T
        weights = (pan.T[:, None, :] * loud) @ self._to_strings  # (channels, steps + 1, modes)
        before, after = self._sounding(weights[:, :-1] * states), self._sounding(weights[:, 1:] * states)
        sound: Samples = before + (after - before) * (np.arange(STEP) / STEP)
        return sound.reshape(pan.shape[1], -1).T

    def _sounding(self, states: Samples) -> Samples:
        """Samples (channels, steps, STEP) of states (channels, steps, modes) at each step's start."""
        channels, steps, modes = states.shape
        sound: Samples = (states.reshape(channels * steps, modes) @ self._ringing).real
        return sound.reshape(channels, steps, STEP)


def _formed(hertz: Samples, formants: Sequence[tuple[float, float]]) -> Samples:
    """Gains (B,) of partials at these frequencies behind a mouth's resonances; 1 without any."""
    if not formants:
        return np.ones(len(hertz))
    gains: Samples = sum((1.0 / np.hypot(1.0, (hertz - at) / width) for at, width in formants), np.zeros(1))
    return 0.15 + gains


def around(places: Samples, channels: int) -> Samples:
    """(B, channels): equal power between the two nearest of a ring of loudspeakers; a pair: left to right."""
    if channels == 2:
        angle = (1.0 + np.sin(places)) * np.pi / 4
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    apart = places[:, None] - np.arange(channels) * (2 * np.pi / channels)
    apart = np.abs((apart + np.pi) % (2 * np.pi) - np.pi)
    gains: Samples = np.cos(np.minimum(apart * channels / 4, np.pi / 2))
    return gains
