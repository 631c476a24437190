"""The strings below 10 Hz: tied to the bones, each whole octaves below its pitch; they drive joints back."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose.skeleton import Skeleton
from appliance.show.sound import StringsConfig
from appliance.show.string_pitches import decays, string_pitches

HIGHEST_HZ = 10.0
TIED_HZ = 2.5  # at gain 1 a single joint on its string oscillates this often
_LONGEST_M = 1.0  # no string is drawn out further, along each axis


class SlowStrings:
    """N strings, one for each bone of a mass-spring system; those of bones without one never move.

    A string is a mode, one complex number an axis: its real part is how far the string is drawn out, and the
    bone's motion draws it; it pulls the bone back by stiffness times that. The string gains the energy that
    the bone loses, and loses it by decay: so neither can drive the other up, whatever the gain. In a step
    that is so
    because the pull is the mean over the turn that the string makes in it: the exact flow of a Hamiltonian,
    as are the masses' drift and the springs' kick. By the string's place before the step, an undamped body
    was driven to ten times its energy.
    """

    SNAPSHOT = ("modes",)

    def __init__(
        self, skeleton: Skeleton, nodes: Sequence[int], config: StringsConfig, step_s: float
    ) -> None:
        """nodes: joint at the end of each bone; the first has none. step_s: seconds of a `follow`."""
        bones, hertz = string_pitches(skeleton, config.base_hz)
        octaves = math.ceil(math.log2(max(hertz.max(initial=1.0) / HIGHEST_HZ, 1.0)))
        pitch = dict(zip(bones[:, 1].tolist(), (hertz / 2**octaves).tolist(), strict=True))
        self.hertz: NDArray[np.float64] = np.array([0.0, *(pitch.get(node, 0.0) for node in nodes[1:])])
        self.modes = np.zeros((len(nodes), 3), complex)
        self.stiffness = np.zeros((len(nodes), 1))  # newtons a metre
        self._has_string = (self.hertz > 0.0)[:, None]
        decay = decays(self.hertz, hertz.min(initial=config.base_hz), config.decay_s)
        turned = np.where(self._has_string, step_s * (2j * np.pi * self.hertz - decay)[:, None], -1.0)
        # Three columns, as the modes have: numpy then takes half the time.
        self._turn = np.repeat(np.exp(turned) * self._has_string, 3, axis=1)
        self._mean = np.repeat(np.expm1(turned) / turned, 3, axis=1)
        self._drawn, self._pulling = self.modes.real, np.zeros_like(self.modes)
        self._opposite, self._force = np.zeros((2, len(nodes), 3))

    def tune(self, gain: float, mass: NDArray[np.float64], most: NDArray[np.float64]) -> None:
        """gain 0..1; mass (N,) at the bones' ends, kilograms; most (N,): stiffness that its step carries."""
        wanted = gain * (2 * np.pi * TIED_HZ) ** 2 * mass
        self.stiffness[:] = np.minimum(wanted, most)[:, None] * self._has_string
        self._opposite[:] = -self.stiffness

    def pull(self) -> NDArray[np.float64]:
        """Forces (N, 3) on the bones' ends, newtons; the bones' starts get their opposites."""
        np.multiply(self.modes, self._mean, out=self._pulling)
        np.multiply(self._pulling.real, self._opposite, out=self._force)
        return self._force

    def follow(self, moves: NDArray[np.float64]) -> None:
        """The bones' ends have moved (N, 3) metres against their starts."""
        np.multiply(self.modes, self._turn, out=self.modes)
        np.add(self._drawn, moves, out=self._drawn)

    def bound(self) -> None:
        """Keep all strings within their length; once a tick."""
        parts = self.modes.view(np.float64)
        np.maximum(parts, -_LONGEST_M, out=parts)
        np.minimum(parts, _LONGEST_M, out=parts)
        self.modes *= self._has_string

    def still(self) -> None:
        """Stop all strings at once."""
        self.modes[:] = 0.0

    def energy(self) -> float:
        """Joules."""
        return float(np.sum(self.stiffness * np.abs(self.modes) ** 2)) / 2
