"""The show state: what show control wants picture, lights and dance to be. All processes read it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from appliance.box.block import BlockWriter
from appliance.box.ring_file import RingFileReader
from appliance.pose.foreign_file import plain_json

FILE, KIND = "show_state", "show_state"
LARGEST = 8192  # bytes; the longest names of a show fit, in any script


@dataclass(frozen=True, slots=True)
class ShowState:
    """What show control has declared; times are monotonic seconds of this machine, names are the show's.

    look, lights: "" is the show's first. Fades run by themselves: readers pass the time at which they draw.

    The stage applies each part of the dance once. `*_set` and the numbers in `hands` are the generation that
    declared a part (0: none did), `generation` is the newest; it grows as long as the machine runs, even if
    the file is deleted. These parts are for the show called `show`: a stage with another show ignores them.
    """

    panic: bool = False
    blackout: bool = False
    going: bool = True  # False after /stop
    going_since: float = 0.0
    going_fade_s: float = 0.0
    master: float = 1.0
    master_before: float = 1.0
    master_since: float = 0.0
    master_fade_s: float = 0.0
    look: str = ""
    look_before: str = ""
    look_since: float = 0.0
    look_fade_s: float = 0.0
    lights: str = ""
    lights_before: str = ""
    lights_since: float = 0.0
    lights_fade_s: float = 0.0
    cue: str = ""  # the newest; "": none yet
    show: str = ""
    generation: int = 0
    phrase: str = ""
    phrase_fade_s: float = 0.0
    phrase_set: int = 0
    coding: int = 0
    interaction: int = 0
    iterations_fade_s: float = 0.0
    iterations_set: int = 0
    rate: float | None = None  # None: the show's
    rate_set: int = 0
    hands: Mapping[str, tuple[bool, int]] = field(default_factory=dict)  # by joint: holds, generation

    def level(self, now: float) -> float:
        """0..1: what dimmers and the picture are multiplied with."""
        if self.panic or self.blackout:
            return 0.0
        return self.master_level(now) * self.going_level(now)

    def is_safe(self, now: float) -> bool:
        """Whether lights show their safe look: at once on panic, and when stopped as soon as it is dark."""
        return self.panic or self.stands(now)

    def stands(self, now: float) -> bool:
        """Whether the phrase stands still: stopped, and faded out."""
        return not self.going and self.going_level(now) <= 0.0

    def master_level(self, now: float) -> float:
        """0..1: the master's fader on its way."""
        part = _part(now, self.master_since, self.master_fade_s)
        return self.master_before * (1.0 - part) + self.master * part

    def going_level(self, now: float) -> float:
        """0..1: 1 while the show goes, on its way to 0 after /stop and back to 1 after /go."""
        part = _part(now, self.going_since, self.going_fade_s)
        return part if self.going else 1.0 - part

    def look_mix(self, now: float) -> float:
        """0..1: how much of `look` is there already; the rest is `look_before`."""
        return _part(now, self.look_since, self.look_fade_s)

    def lights_mix(self, now: float) -> float:
        """0..1: how much of the mappings `lights` is there already; the rest is `lights_before`."""
        return _part(now, self.lights_since, self.lights_fade_s)

    def with_going(self, going: bool, now: float, fade_s: float) -> ShowState:
        """Stop or go on from the brightness of this moment; `fade_s` is for the whole way."""
        level = self.going_level(now)
        done = level if going else 1.0 - level
        return replace(self, going=going, going_since=now - done * fade_s, going_fade_s=fade_s)

    def with_master(self, master: float, now: float, fade_s: float) -> ShowState:
        """Another master, from the one of this moment."""
        before = self.master_level(now)
        return replace(self, master=master, master_before=before, master_since=now, master_fade_s=fade_s)

    def with_look(self, look: str, now: float, fade_s: float) -> ShowState:
        """Another look, from the one that is seen most at this moment."""
        before = self.look if self.look_mix(now) >= 0.5 else self.look_before
        return replace(self, look=look, look_before=before, look_since=now, look_fade_s=fade_s)

    def with_lights(self, lights: str, now: float, fade_s: float) -> ShowState:
        """Another set of light mappings, from the one that is seen most at this moment."""
        before = self.lights if self.lights_mix(now) >= 0.5 else self.lights_before
        return replace(self, lights=lights, lights_before=before, lights_since=now, lights_fade_s=fade_s)

    def with_cue(self, cue: str, now: float) -> ShowState:
        """The newest cue; what it calls up is declared part by part."""
        return replace(self, generation=self._next_generation(now), cue=cue)

    def with_phrase(self, phrase: str, now: float, fade_s: float) -> ShowState:
        """Call a phrase; calling the same one again is another call."""
        number = self._next_generation(now)
        return replace(self, generation=number, phrase=phrase, phrase_fade_s=fade_s, phrase_set=number)

    def with_iterations(self, coding: int, interaction: int, now: float, fade_s: float = 0.0) -> ShowState:
        """Other coding and interaction iterations."""
        number = self._next_generation(now)
        return replace(
            self,
            generation=number,
            coding=coding,
            interaction=interaction,
            iterations_fade_s=fade_s,
            iterations_set=number,
        )

    def with_rate(self, rate: float | None, now: float) -> ShowState:
        """Another speed of the phrase; None: the show's."""
        number = self._next_generation(now)
        return replace(self, generation=number, rate=rate, rate_set=number)

    def with_hands(self, holds: Mapping[str, bool], now: float) -> ShowState:
        """Let the hands of these joints hold, or let go."""
        number = self._next_generation(now)
        hands = {**self.hands, **{joint: (held, number) for joint, held in holds.items()}}
        return replace(self, generation=number, hands=hands)

    def for_show(self, show: str) -> ShowState:
        """Without the cue and the dance of another show."""
        if show == self.show:
            return self
        none: dict[str, Any] = {
            "phrase_set": 0,
            "iterations_set": 0,
            "rate": None,
            "rate_set": 0,
            "hands": {},
        }
        return replace(self, show=show, cue="", phrase="", **none)

    def settled(self, now: float) -> ShowState:
        """With fades that began in the future done: the machine's clock has started anew since."""
        late = max(self.going_since, self.master_since, self.look_since, self.lights_since) > now
        if not late:
            return self
        return replace(self, going_fade_s=0.0, master_fade_s=0.0, look_fade_s=0.0, lights_fade_s=0.0)

    def _next_generation(self, now: float) -> int:
        """Nanoseconds since the machine started, so that a new file never repeats an earlier number."""
        return max(self.generation + 1, int(1e9 * now))


_FIELDS = tuple(one.name for one in fields(ShowState))


class ShowStateReader:
    """Reads the show state of a runtime folder; before one is written the defaults hold: the show runs.

    An unchanged state costs a stat and eight bytes.

    A file that is gone stays in force until another one is written: panic stays panic when the folder is
    emptied, and what is dark does not flash up while a box ends.
    """

    def __init__(self, folder: Path) -> None:
        self._file = RingFileReader(folder / FILE, KIND, 1, "show control")
        self._sequence = 0
        self._show_state = ShowState()

    def read(self) -> ShowState:
        """The newest show state, the same object until it changes. Never waits, never raises."""
        if self._file.look():
            self._sequence = 0
        for ring in self._file.rings:
            if ring.newest_sequence() != self._sequence and (newest := ring.newest()):
                self._sequence, self._show_state = newest[0], _parsed(newest[1])
        return self._show_state

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


class ShowStateWriter:
    """Show control's end: the file outlives it, so that panic stays panic. Raises OSError."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, LARGEST)

    def write(self, show_state: ShowState) -> None:
        """Publish; readers have it from their next read on."""
        values = {name: getattr(show_state, name) for name in _FIELDS}
        self._block.write(json.dumps(values, ensure_ascii=False).encode())

    def close(self) -> None:
        """Let go of the file; it stays."""
        self._block.close()


def forget_show_state(folder: Path) -> None:
    """A show that ended as it should leaves nothing in force for the next one."""
    (folder / FILE).unlink(missing_ok=True)


def _part(now: float, since: float, fade_s: float) -> float:
    """How much of a fade is over, 0..1."""
    if fade_s <= 0.0:
        return 1.0
    return min(max((now - since) / fade_s, 0.0), 1.0)


def _parsed(payload: bytes) -> ShowState:
    """A show state of another version of this program keeps what both know."""
    try:
        values: dict[str, Any] = plain_json(payload)
        values["hands"] = {joint: (held, number) for joint, (held, number) in values.get("hands", {}).items()}
        return ShowState(**{name: value for name, value in values.items() if name in _FIELDS})
    except (ValueError, TypeError, AttributeError):
        return ShowState()
