"""Repertoire: the phrases of a show by name, and loops and reading heads as plain values with those names."""

from __future__ import annotations

from typing import Any

import numpy as np

from appliance.dancer.grounding import Floor
from appliance.dancer.loop import Loop, Placement
from appliance.dancer.phrase import FPS, NUMBER, Phrase, PhraseError
from appliance.dancer.reading_head import ReadingHead
from appliance.pose.recording import Recording
from appliance.show.config_error import did_you_mean
from appliance.show.sources import MAIN


class Repertoire:
    """Phrases of one skeleton and the whole loop of each. names: in their order."""

    def __init__(self, main: Phrase, excerpt: Loop, fade: int, window: int) -> None:
        """main: the phrase with which the show starts; excerpt: the loop of it that plays. fade: frames."""
        self._skeleton = main.skeleton
        self._fade, self._window = fade, window
        self._phrases = {MAIN: (main, excerpt)}
        self.names: tuple[str, ...] = (MAIN,)

    def add(self, name: str, recording: Recording, floor: Floor | None) -> None:
        """Add a phrase. Raises PhraseError."""
        if not recording.skeleton.same_joints(self._skeleton):
            raise PhraseError(f"The phrase '{name}' has other joints than '{MAIN}'. Nothing can be danced.")
        ready = Phrase(len(self._phrases), name, recording, floor, self._fade, self._window)
        self._phrases[name] = ready, ready.cut(0.0, None)
        self.names = tuple(self._phrases)

    def find(self, name: str) -> tuple[Phrase, Loop]:
        """A phrase and its whole loop. Raises ValueError with the nearest name."""
        if name not in self._phrases:
            raise ValueError(f"This show has no phrase '{name}'. {did_you_mean(name, self.names)}")
        return self._phrases[name]

    def named(self, loop: Loop) -> list[Any]:
        """A loop as plain values: phrase, first second, frames, and whether it is the phrase's whole loop."""
        name = self.names[round(float(loop.track[0, NUMBER]))]
        return [name, loop.start_s, loop.length, loop is self._phrases[name][1]]

    def loop(self, named: list[Any]) -> Loop:
        """The loop of the values from `named`. Raises KeyError, PhraseError."""
        name, start_s, length, is_own = named
        phrase, own = self._phrases[name]
        return own if is_own else phrase.cut(start_s, start_s + length / FPS)

    def head_state(self, head: ReadingHead) -> dict[str, Any]:
        """A reading head as plain values and copies of arrays."""
        place = head.placement
        return {
            "loop": self.named(head.loop),
            "position": float(head.position),
            "pose": head.pose.copy(),
            "placement": [float(place.yaw), float(place.x), float(place.z)],
        }

    def head(self, state: dict[str, Any]) -> ReadingHead:
        """The reading head of a `head_state`. Raises as `loop` does."""
        pose = np.array(state["pose"], dtype=np.float32)
        return ReadingHead(self.loop(state["loop"]), state["position"], pose, Placement(*state["placement"]))
