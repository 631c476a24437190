"""Requests for motion, which the show state makes, as recipes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from appliance.levers.show_state import Part, ShowState, parts_of
from appliance.levers.sources import GRANULAR, IMPROVISE, KEPT, MADE, PARAMETERS, PATH, POINTS
from appliance.levers.table import MOTION
from appliance.show.show import ShowConfig

STEP_S = 1.5  # seconds of a fade: each step is a separate motion, blended into the one before
AGAIN = 1000  # seed step per `again`; each return adds one
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
        kept: Mapping[str, dict[str, Any]],
        now: float,
        wanted: str = "",
        puppet: int = 0,
        pointed: Sequence[float] = (),
    ) -> Request | None:
        """A puppet's open request; None: phrases or a live dancer. base: the phrase that it danced last.

        kept: recipes of kept motions by name. now: monotonic seconds. wanted: what the first puppet waits for
        while nothing is declared, after a power cut. pointed: x, y of the map at which a hand points.
        """
        dance: Mapping[str, Part] = parts_of(state) if state.show == self._config.name else {}
        if puppet:
            name = self._config.puppets[puppet].phrase or ""
        else:
            name = dance["phrase"][1] if "phrase" in dance else wanted or self._config.motion.source
        if name in kept:
            return Request(name, {"source": KEPT, "name": name, "of": kept[name]})
        if name not in MADE or name not in self._sections:
            return None
        recipe: dict[str, Any] = {"source": name}
        for parameter, about in PARAMETERS[name].items():
            value = self._value(dance, name, parameter, now)
            recipe[parameter] = int(value) if about.is_whole else round(value, _DIGITS)
        recipe["seed"] += AGAIN * int(dance.get(f"{MOTION} again", (0, "", (0.0,)))[2][0]) + APART * puppet
        if name == GRANULAR:
            section = self._sections[name]
            recipe |= {"from": getattr(section, "from_", None), "to": getattr(section, "to", None)}
        elif name != IMPROVISE:
            recipe["phrase"] = base
        points = pointed or dance.get(f"{MOTION} {PATH} {POINTS}", (0, "", ()))[2]
        if name == PATH and points:
            recipe["points"] = [round(value, 3) for value in points]
        return Request(name, recipe)

    def _value(self, dance: Mapping[str, Part], source: str, parameter: str, now: float) -> float:
        """A parameter at this moment; a fade goes in steps."""
        key = f"{MOTION} {source} {parameter}"
        own = float(getattr(self._sections[source], parameter))
        number, _, values = dance.get(key, (0, "", ()))
        if not values:
            return own
        if self._fading.get(key, (0, 0.0))[0] != number:
            self._fading[key] = number, self._newest.get(key, own)
        target, fade_s = values[0], values[1] if len(values) > 1 else 0.0
        before, since = self._fading[key][1], number / 1e9  # declared at that monotonic second
        gone = math.floor(max(now - since, 0.0) / STEP_S + 1.0) * STEP_S
        share = 1.0 if gone >= fade_s or PARAMETERS[source][parameter].is_whole else gone / fade_s
        value = self._newest[key] = before + share * (target - before)
        return value
