"""Repertoire: phrases by name and loops that were made ahead by recipe, as plain values too."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from appliance.dancer.grounding import Floor
from appliance.dancer.loop import Loop, Placement
from appliance.dancer.phrase import FPS, NUMBER, SHARED, Phrase, PhraseError
from appliance.dancer.playhead import Playhead
from appliance.levers.sources import GRANULAR, IMPROVISE, MAIN, PATH
from appliance.pose.recording import Recording
from appliance.show.config_error import did_you_mean

FIRST_MADE = 1000  # numbers of loops that were made ahead; phrases have lower ones
_MOST_MADE = 6  # the newest ones: a crossfade and the window know four at most


class Made(NamedTuple):
    """A loop that was made ahead. phrase: the one whose seconds it follows; "": it has its own. after: the
    number of the loop that it goes on from, and the second of that where it begins; None: from none.
    """

    recipe: str
    name: str
    phrase: str
    number: int
    loop: Loop
    after: tuple[int, float] | None = None

    def begin_after(self, here: Loop, position: float) -> float:
        """The frame with which it begins after this frame of a loop: in step, where it goes on from there."""
        first = max(0.0, -self.loop.start_s * FPS)
        if self.after is None or round(float(here.track[0, NUMBER])) != self.after[0]:
            return first
        ahead = (here.start_s - self.after[1]) * FPS + position
        return first + ahead if 0.0 <= ahead <= SHARED else first


class Repertoire:
    """Phrases of one skeleton and the whole loop of each. names: in their order.

    make: gives the loop of a recipe, for a state that names one that is not here; raises ValueError.
    """

    make: Callable[[str], Loop]

    def __init__(self, main: Phrase, excerpt: Loop, fade: int, window: int) -> None:
        """main: the phrase with which the show starts; excerpt: the loop of it that plays. fade: frames."""
        self._skeleton = main.skeleton
        self._fade, self._window = fade, window
        self._phrases = {MAIN: (main, excerpt)}
        self.names: tuple[str, ...] = (MAIN,)
        self._made: dict[int, Made] = {}
        self.make = _unmade

    def another(self) -> Repertoire:
        """A repertoire of the same phrases, which both share, and of nothing that was made ahead."""
        other = copy(self)
        other._made = {}
        return other

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

    def take(self, recipe: str, loop: Loop) -> Made:
        """Take in a loop that was made ahead. Raises ValueError for no recipe of this show."""
        try:
            values = json.loads(recipe)
            kind = values.get("of", values)
            own = kind.get("points") or kind["source"] in (GRANULAR, IMPROVISE)
            phrase = "" if own else str(kind["phrase"])
            after = (int(values["after"]), float(values["from_s"])) if "after" in values else None
            loop.turns_home = kind["source"] in (GRANULAR, PATH)
            name, number = str(values.get("name") or values["source"]), int(values["number"])
        except (AttributeError, LookupError, TypeError) as error:
            raise ValueError(f"It was made by no sound recipe ({error}).") from None
        if loop.track.shape[1] != self._phrases[MAIN][1].track.shape[1] or number < FIRST_MADE:
            raise ValueError("It was made for another floor, or another show.")
        made = self._made[number] = Made(recipe, name, phrase, number, loop, after)
        for old in [*self._made][:-_MOST_MADE]:
            del self._made[old]
        return made

    def made(self, loop: Loop) -> Made | None:
        """The metadata of a loop that was made ahead; None for one of a phrase."""
        return self._made.get(round(float(loop.track[0, NUMBER])))

    def name_of(self, number: int) -> str:
        """The name of a phrase, or of what was made ahead, by the number in its track."""
        if number < FIRST_MADE:
            return self.names[number]
        return self._made[number].name if number in self._made else ""

    def named(self, loop: Loop) -> list[Any]:
        """A loop as plain values: phrase or recipe, first second, frames, and whether it is a whole loop."""
        if (made := self.made(loop)) is not None:
            return [made.recipe, loop.start_s, loop.length, True]
        name = self.names[round(float(loop.track[0, NUMBER]))]
        return [name, loop.start_s, loop.length, loop is self._phrases[name][1]]

    def loop(self, named: list[Any]) -> Loop:
        """The loop of the values from `named`. Raises KeyError, PhraseError, ValueError."""
        name, start_s, length, is_own = named
        if name not in self._phrases and name.startswith("{"):
            known = next((made for made in self._made.values() if made.recipe == name), None)
            return (known or self.take(name, self.make(name))).loop
        phrase, own = self._phrases[name]
        return own if is_own else phrase.cut(start_s, start_s + length / FPS)

    def head_state(self, head: Playhead) -> dict[str, Any]:
        """A playhead as plain values and copies of arrays."""
        place = head.placement
        return {
            "loop": self.named(head.loop),
            "position": float(head.position),
            "pose": head.pose.copy(),
            "placement": [float(place.yaw), float(place.x), float(place.z)],
        }

    def head(self, state: dict[str, Any]) -> Playhead:
        """The playhead of a `head_state`. Raises as `loop` does."""
        pose = np.array(state["pose"], dtype=np.float32)
        return Playhead(self.loop(state["loop"]), state["position"], pose, Placement(*state["placement"]))


def _unmade(recipe: str) -> Loop:
    raise ValueError("Nothing was made by this recipe here.")
