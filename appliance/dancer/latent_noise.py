"""Noise for the latent: a smooth random offset that depends only on a seed and the absolute tick."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appliance.box.clock import TICK_S
from appliance.dancer.slerp import FloatArray

SLOWEST_HZ, FASTEST_HZ = 0.03, 0.25  # one move of the body, not a tremor
SINUSOIDS = 6  # per latent
CROSSFADE_TICKS = 100  # from one seed's noise to another's: 2 s

_Phases = NDArray[np.uint32]  # 2**32 is a whole turn: sums wrap around exactly, after months too
_RADIANS = np.float32(math.pi / 2**31)


class LatentNoise:
    """Noise (P, Z) for the latents of P puppets: mean 0 and variance 1 over time, float32.

    Each latent is a sum of sinusoids whose frequencies, phases and weights are drawn once from the seed. The
    noise is a closed form of the tick, so overlapping windows, a restarted stage, a replay and a second box
    have the same. Puppet p has the noise of the seed plus p.

    noise: of the newest tick. seed: the newest that was asked for. begins_at: the absolute tick of this
    stage's tick 0.
    """

    SNAPSHOT = ("_seeds", "begins_at", "_newest", "_since")

    def __init__(self, seed: int, puppets: int, latents: int) -> None:
        self.seed, self.begins_at = seed, 0
        self._shape = puppets, latents
        self.noise: FloatArray = np.zeros(self._shape, np.float32)
        self._other: FloatArray = np.zeros(self._shape, np.float32)
        self._phases: _Phases = np.zeros((SINUSOIDS, *self._shape), np.uint32)
        self._signed = self._phases.view(np.int32)  # the same angles, from half a turn back to half a turn on
        self._sines: FloatArray = np.zeros((SINUSOIDS, *self._shape), np.float32)
        self._waves = self._before = self._next = _Waves(seed, *self._shape)
        self._newest = -1  # absolute tick of the newest noise
        self._since = -CROSSFADE_TICKS  # the absolute tick at which the crossfade began

    def change(self, seed: int) -> None:
        """Cross over to another seed from the next tick on; before the first tick, at once.

        A seed that comes during a crossfade waits for its end; of several that wait, the newest counts.
        """
        self.seed = seed
        self._next = self._waves if seed == self._waves.seed else _Waves(seed, *self._shape)
        if self._newest < self.begins_at:
            self._waves = self._before = self._next

    def at(self, tick: int) -> FloatArray:
        """The noise (P, Z) at one of this stage's ticks; overwritten each time.

        The noises of two seeds are independent, so the crossfade keeps the variance by equal power.
        """
        now = tick + self.begins_at
        if self._next is not self._waves and now - self._since >= CROSSFADE_TICKS:
            self._before, self._waves, self._since = self._waves, self._next, max(self._newest, 0)
        self._newest = now
        noise = self._sum(self._waves, now, self.noise)
        if (part := (now - self._since) / CROSSFADE_TICKS) < 1.0:
            other = self._sum(self._before, now, self._other)
            np.multiply(noise, np.float32(math.sin(0.5 * math.pi * part)), out=noise)
            np.multiply(other, np.float32(math.cos(0.5 * math.pi * part)), out=other)
            np.add(noise, other, out=noise)
        return noise

    @property
    def _seeds(self) -> tuple[int, int, int]:
        return self._before.seed, self._waves.seed, self._next.seed

    @_seeds.setter
    def _seeds(self, seeds: tuple[int, int, int]) -> None:
        before, now, self.seed = seeds
        self._before, self._waves = _Waves(before, *self._shape), _Waves(now, *self._shape)
        self._next = self._waves if self.seed == now else _Waves(self.seed, *self._shape)

    def _sum(self, waves: _Waves, tick: int, out: FloatArray) -> FloatArray:
        phases, sines = self._phases, self._sines
        np.multiply(waves.steps, np.uint32(tick % 2**32), out=phases)
        np.add(phases, waves.phases, out=phases)
        np.multiply(self._signed, _RADIANS, out=sines, dtype=np.float32, casting="unsafe")
        np.sin(sines, out=sines)
        np.multiply(sines, waves.weights, out=sines)
        return np.add.reduce(sines, axis=0, out=out)


class _Waves:
    """The sinusoids of one seed, each array (SINUSOIDS, P, Z): one frequency in each part of the range.

    steps: phase of one tick. Raw numbers of the bit generator: numpy keeps these the same in all releases.
    """

    def __init__(self, seed: int, puppets: int, latents: int) -> None:
        self.seed = seed
        drawn = np.stack([_uniform(seed + puppet, (3, SINUSOIDS, latents)) for puppet in range(puppets)], 2)
        parts = (np.arange(SINUSOIDS)[:, None, None] + drawn[0]) / SINUSOIDS
        hertz = SLOWEST_HZ * (FASTEST_HZ / SLOWEST_HZ) ** parts
        self.steps: _Phases = np.rint(2**32 * TICK_S * hertz).astype(np.uint32)
        self.phases: _Phases = (2**32 * drawn[1]).astype(np.uint32)
        weights = 0.5 + 0.5 * drawn[2]
        weights *= np.sqrt(2.0 / np.sum(weights**2, axis=0))  # half the squares add up to the variance
        self.weights: FloatArray = weights.astype(np.float32)


def _uniform(seed: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Numbers from 0 to 1 in this shape."""
    raw = np.random.PCG64(seed).random_raw(math.prod(shape))
    uniform: NDArray[np.float64] = (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return uniform.reshape(shape)
