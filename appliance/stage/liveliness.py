"""How alive the puppets answer a hand: how much of the phrase's movement stays, and the noise."""

from __future__ import annotations

import secrets
from collections.abc import Sequence

from appliance.dancer.latent_noise import LatentNoise
from appliance.dancer.phrase import FPS
from appliance.stage.stage_puppet import StagePuppet

DRAWN_SEEDS = 1_000_000  # six digits: easily noted down, and exact as a float of OSC
LEAST_FADE_S = 0.5  # a faster change would be seen as a jerk of the whole body


class Liveliness:
    """The liveliness 0..1 of all puppets on its way to the newest that was asked for, and their noise.

    level: at this tick; asked: at the end of its fade.
    """

    SNAPSHOT = ("level", "asked", "_before", "_tick", "_ticks", "_has_danced", "_noise")

    def __init__(self, level: float, seed: int | None, puppets: Sequence[StagePuppet]) -> None:
        """seed None: drawn anew."""
        self.level = self.asked = level
        self._puppets, latents = tuple(puppets), puppets[0].puppet.latent
        drawn = secrets.randbelow(DRAWN_SEEDS) if seed is None else seed
        self._noise = LatentNoise(drawn, len(puppets), latents)
        for one, noise in zip(puppets, self._noise.noise, strict=True):
            one.liveliness, one.noise = level, noise
        self._before = level
        self._tick = self._ticks = 0
        self._has_danced = False

    @property
    def seed(self) -> int:
        """The newest that was asked for."""
        return self._noise.seed

    @property
    def begins_at(self) -> int:
        """The absolute tick of this stage's tick 0: a restarted stage goes on in the last one's noise."""
        return self._noise.begins_at

    def ask(self, level: float, fade_s: float = 0.0) -> None:
        """Go to another level within fade_s, at least LEAST_FADE_S; before the first tick, at once."""
        self.asked, self._before = level, self.level
        self._tick, self._ticks = 0, round(max(fade_s, LEAST_FADE_S) * FPS)
        if not self._has_danced:
            self.level, self._tick = level, self._ticks

    def change_seed(self, seed: int) -> None:
        """Cross over to the noise of another seed; before the first tick, at once."""
        self._noise.change(seed)

    def go_on(self, level: float, seed: int, begins_at: int) -> None:
        """Before the first tick: continue where another stage was."""
        self._noise.begins_at = begins_at
        self.ask(level)
        self.change_seed(seed)

    def dance(self, tick: int) -> None:
        """Give the puppets their liveliness and noise of this stage's tick; the network scales the noise."""
        self._has_danced = True
        for one in self._puppets:
            one.liveliness = self.level
        self._noise.at(tick)

    def advance(self) -> None:
        """The frame has left: one tick further on the way."""
        if self._tick < self._ticks:
            self._tick += 1
            share = self._tick / self._ticks
            self.level = self._before + share * (self.asked - self._before)
