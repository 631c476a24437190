"""How often the puppet goes over a window: within what fits the budget, changed at once or in steps."""

from __future__ import annotations

from dataclasses import dataclass

from appliance.dancer.phrase import FPS


@dataclass(slots=True)
class Iterations:
    """Coding and interaction iterations; orders may change them up to `most`, which fits the budget.

    wished: what the show or the newest order asked for, though fewer may fit.
    """

    SNAPSHOT = ("coding", "interaction", "most", "wished", "_before", "_wanted", "_tick", "_ticks")

    coding: int
    interaction: int
    most: int
    wished: tuple[int, int] = (1, 0)
    _before: tuple[int, int] = (0, 0)
    _wanted: tuple[int, int] = (0, 0)
    _tick: int = 0
    _ticks: int = 0

    def ask(self, coding: int, interaction: int, fade_s: float = 0.0) -> str:
        """Take as many as fit, over fade_s; a sentence when these are fewer than were asked for."""
        allowed = min(max(coding, 1), self.most)
        self.wished = coding, interaction
        self._before = self.coding, self.interaction
        fitting = min(interaction - max(coding - allowed, 0), allowed)
        self._wanted = allowed, max(fitting, min(interaction, 1))  # a hand that is to hold holds
        self._tick, self._ticks = 0, max(1, round(fade_s * FPS))
        if self._ticks == 1:
            self.advance()
        if self._wanted == (coding, interaction):
            return ""
        why = "the interaction iterations are part of the coding iterations, and there is at least one"
        if coding > self.most:
            why = f"at most {self.most} fit the tick's budget here"
        return (
            f"{coding} coding and {interaction} interaction iterations were asked for; "
            f"the dancer runs with {self._wanted[0]} and {self._wanted[1]}: {why}."
        )

    def allow(self, most: int) -> None:
        """More fit than was measured at the start: dance what was last asked for."""
        self.most = most
        self.ask(*self.wished)

    @property
    def asked(self) -> tuple[int, int]:
        """Coding and interaction iterations at the end of the way that they are on."""
        return (self.coding, self.interaction) if self._tick == self._ticks else self._wanted

    def advance(self) -> None:
        """One tick further on the way to what was asked for, in whole iterations: each is a small step."""
        if self._tick == self._ticks:
            return
        self._tick += 1
        share = self._tick / self._ticks
        self.coding, self.interaction = (
            int(before + share * (wanted - before) + 0.5)
            for before, wanted in zip(self._before, self._wanted, strict=True)
        )
