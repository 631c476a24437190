"""Requests for motion, which the show state makes, as recipes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from appliance.levers.show_state import ShowState
from appliance.levers.sources import GRANULAR, IMPROVISE, KEPT, MADE, PARAMETERS, PATH
from appliance.levers.table import AGAIN, MADE_NUMBERS, PATH_POINTS, PHRASE
from appliance.show.puppets import PuppetStart
from appliance.show.show import ShowConfig

STEP_S = 1.5  # seconds of a fade: each step is a separate motion, blended into the one before
AGAIN_SEEDS = 1000  # seed step per `again`; each return adds one
APART = 10_000_000  # seeds of one puppet and the next: no two dance the same variation
_DIGITS = 4


class Request(NamedTuple):
    """name: as it is called; recipe: of the first return, without a number."""

    name: str
    recipe: dict[str, Any]

    @property
    def is_new_at_return(self) -> bool:
        """Whether each return is danced anew."""
        return self.recipe["source"] not in (PATH, KEPT)


class Requests:
    """Reads the show state as recipes; fades start from what was in force."""

    def __init__(self, config: ShowConfig) -> None:
        self._config = config
        self._sections = config.motion.made_sources
        self._fading: dict[str, tuple[int, float]] = {}  # by part: its generation, the value before
        self._newest: dict[str, float] = {}  # by part: the value that was asked for last

    def request(
        self,
        state: ShowState,
        base: str,
        saved: Mapping[str, dict[str, Any]],
        now: float,
        wanted: str = "",
        puppet: PuppetStart | None = None,
        pointed: Sequence[float] = (),
    ) -> Request | None:
        """A puppet's open request; None: phrases or a live dancer. base: the phrase that it danced last.

        saved: recipes of kept motions by name. now: monotonic seconds. wanted: what the puppet that cues lead
        waits for while nothing is declared, after a power cut. puppet: None: that one. pointed: x, y of the
        map at which a hand points.
        """
        if state.show != self._config.name:
            state = ShowState()
        puppet = puppet or self._config.led
        name = puppet.source
        if puppet.is_led:
            name = state[PHRASE].value if PHRASE in state else wanted or name
        if name in saved:
            return Request(name, {"source": KEPT, "name": name, "of": saved[name]})
        if name not in MADE or name not in self._sections:
            return None
        recipe: dict[str, Any] = {"source": name}
        for parameter, about in PARAMETERS[name].items():
            value = self._value(state, name, parameter, now)
            recipe[parameter] = int(value) if about.is_whole else round(value, _DIGITS)
        recipe["seed"] += AGAIN_SEEDS * state[AGAIN].value + APART * puppet.number
        if name == GRANULAR:
            section = self._sections[name]
            recipe |= {"from": getattr(section, "from_", None), "to": getattr(section, "to", None)}
        elif name != IMPROVISE:
            recipe["phrase"] = base
        points = pointed or state[PATH_POINTS].value
        if name == PATH and points:
            recipe["points"] = [round(value, 3) for value in points]
        return Request(name, recipe)

    def _value(self, state: ShowState, source: str, parameter: str, now: float) -> float:
        """A parameter at this moment; a fade goes in steps."""
        lever = MADE_NUMBERS[source][parameter]
        own = float(getattr(self._sections[source], parameter))
        if lever not in state:
            return own
        fade, key = state[lever], lever.name
        number = fade.generation
        if self._fading.get(key, (0, 0.0))[0] != number:
            self._fading[key] = number, self._newest.get(key, own)
        before = self._fading[key][1]
        gone = math.floor(max(now - fade.since, 0.0) / STEP_S + 1.0) * STEP_S
        share = 1.0 if gone >= fade.seconds or PARAMETERS[source][parameter].is_whole else gone / fade.seconds
        value = self._newest[key] = before + share * (fade.value - before)
        return value
