"""Takeover: from the phrase to another source and back, over a fade."""

from __future__ import annotations

from appliance.pose.ease import ease


class Takeover:
    """The common part of a source and its fade, once a tick."""

    SNAPSHOT: tuple[str, ...] = ("_chosen", "_share", "_step")

    def __init__(self, tick_s: float) -> None:
        self._tick_s = tick_s
        self._chosen, self._share, self._step = False, 0.0, 1.0

    @property
    def is_chosen(self) -> bool:
        """Whether the puppet is to start from it."""
        return self._chosen

    @property
    def share(self) -> float:
        """How much of what the puppet starts from it is, 0..1."""
        return ease(self._share)

    def choose(self, chosen: bool, fade_s: float) -> None:
        """Take over from the phrase, or give back to it, over fade_s."""
        self._chosen, self._step = chosen, min(1.0, self._tick_s / max(fade_s, self._tick_s))

    def _fade(self, comes: bool) -> None:
        """A tick on towards it, or back."""
        self._share = min(1.0, self._share + self._step) if comes else max(0.0, self._share - self._step)
