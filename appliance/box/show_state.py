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
MOTION = "motion "  # so begin parts of the dance that are for the generator
LARGEST = 8192  # bytes; the longest names of a show fit, in any script

_FADED = ("going", "master", "look", "card", "camera", "lights", "strings")
Part = tuple[int, str, tuple[float, ...]]  # the generation that declared it, a text, numbers


@dataclass(frozen=True, slots=True)
class ShowState:
    """What show control has declared; times are monotonic seconds of this machine, names are the show's.

    look, lights: "" is the show's first; card: "" is none; camera: what differs from the look's, by key.
    Fades run by themselves: readers pass the time at which they draw.

    dance: what the stage applies, each part once, in this order: `cue` (name), `phrase` (name; fade in
    seconds), `iterations` (coding, interaction, fade in seconds), `liveliness` (0 to 1; fade in seconds),
    `seed` (of the answer's noise), `rate` (of playback; none: the show's), `hand JOINT` (joint; 1 holds).
    For the generator: `motion SOURCE NAME` (value; fade in seconds), `motion path points` (x, y of each),
    `motion again` (how often). A stage with another show than `show` ignores it.
    generation: the newest that declared something for the dance, in nanoseconds since the machine started.
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
    card: str = ""
    card_before: str = ""
    card_since: float = 0.0
    card_fade_s: float = 0.0
    camera: Mapping[str, float | str] = field(default_factory=dict)
    camera_before: Mapping[str, float | str] = field(default_factory=dict)
    camera_since: float = 0.0
    camera_fade_s: float = 0.0
    lights: str = ""
    lights_before: str = ""
    lights_since: float = 0.0
    lights_fade_s: float = 0.0
    strings: float = 1.0  # how loud they are
    strings_before: float = 1.0
    strings_since: float = 0.0
    strings_fade_s: float = 0.0
    cue: str = ""  # the newest; "": none yet
    show: str = ""
    generation: int = 0
    dance: Mapping[str, Part] = field(default_factory=dict)

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
        part = part_of_fade(now, self.master_since, self.master_fade_s)
        return self.master_before * (1.0 - part) + self.master * part

    def going_level(self, now: float) -> float:
        """0..1: 1 while the show goes, on its way to 0 after /stop and back to 1 after /go."""
        part = part_of_fade(now, self.going_since, self.going_fade_s)
        return part if self.going else 1.0 - part

    def look_mix(self, now: float) -> float:
        """0..1: how much of `look` is there already; the rest is `look_before`."""
        return part_of_fade(now, self.look_since, self.look_fade_s)

    def card_mix(self, now: float) -> float:
        """0..1: how much of `card` is there already; the rest is `card_before`."""
        return part_of_fade(now, self.card_since, self.card_fade_s)

    def camera_mix(self, now: float) -> float:
        """0..1: how far the camera is on its way from `camera_before` to `camera`."""
        return part_of_fade(now, self.camera_since, self.camera_fade_s)

    def lights_mix(self, now: float) -> float:
        """0..1: how much of the mappings `lights` is there already; the rest is `lights_before`."""
        return part_of_fade(now, self.lights_since, self.lights_fade_s)

    def with_going(self, going: bool, now: float, fade_s: float) -> ShowState:
        """Stop or go on from the brightness of this moment; `fade_s` is for the whole way."""
        level = self.going_level(now)
        done = level if going else 1.0 - level
        return replace(self, going=going, going_since=now - done * fade_s, going_fade_s=fade_s)

    def with_master(self, master: float, now: float, fade_s: float) -> ShowState:
        """Another master, from the one of this moment."""
        before = self.master_level(now)
        return replace(self, master=master, master_before=before, master_since=now, master_fade_s=fade_s)

    def strings_level(self, now: float) -> float:
        """0..1: how loud the strings are, on its way; master comes on top."""
        part = part_of_fade(now, self.strings_since, self.strings_fade_s)
        return self.strings_before * (1.0 - part) + self.strings * part

    def with_strings(self, strings: float, now: float, fade_s: float) -> ShowState:
        """Another loudness of the strings, from the one of this moment."""
        before = self.strings_level(now)
        return replace(self, strings=strings, strings_before=before, strings_since=now, strings_fade_s=fade_s)

    def with_look(self, look: str, now: float, fade_s: float) -> ShowState:
        """Another look, from the one that is seen most at this moment."""
        before = self.look if self.look_mix(now) >= 0.5 else self.look_before
        return replace(self, look=look, look_before=before, look_since=now, look_fade_s=fade_s)

    def with_card(self, card: str, now: float, fade_s: float) -> ShowState:
        """Another card, from the one that is seen most at this moment; "": none."""
        before = self.card if self.card_mix(now) >= 0.5 else self.card_before
        return replace(self, card=card, card_before=before, card_since=now, card_fade_s=fade_s)

    def with_camera(self, camera: Mapping[str, float | str], now: float, fade_s: float) -> ShowState:
        """Another place of the camera, from the one that is nearest at this moment; {}: the look's."""
        before = self.camera if self.camera_mix(now) >= 0.5 else self.camera_before
        return replace(self, camera=camera, camera_before=before, camera_since=now, camera_fade_s=fade_s)

    def with_lights(self, lights: str, now: float, fade_s: float) -> ShowState:
        """Another set of light mappings, from the one that is seen most at this moment."""
        before = self.lights if self.lights_mix(now) >= 0.5 else self.lights_before
        return replace(self, lights=lights, lights_before=before, lights_since=now, lights_fade_s=fade_s)

    def with_dance(self, now: float, parts: Mapping[str, tuple[str, tuple[float, ...]]]) -> ShowState:
        """Declare parts of the dance; a part that is declared as it is already is applied once more."""
        number = max(self.generation + 1, int(1e9 * now))  # a new file never repeats an earlier number
        others = {name: part for name, part in self.dance.items() if name not in parts}
        declared = {name: (number, *part) for name, part in parts.items()}
        return replace(self, generation=number, dance=others | declared)

    def for_show(self, show: str) -> ShowState:
        """Without the cue, the camera and the dance of another show."""
        if show == self.show:
            return self
        return replace(self, show=show, cue="", dance={}, camera={}, camera_before={})

    def settled(self, now: float) -> ShowState:
        """With fades that began in the future done: the machine's clock has restarted since."""
        if max(getattr(self, f"{part}_since") for part in _FADED) <= now:
            return self
        done: dict[str, Any] = {f"{part}_fade_s": 0.0 for part in _FADED}
        return replace(self, **done)


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


def part_of_fade(now: float, since: float, fade_s: float) -> float:
    """How much of a fade is over, 0..1."""
    if fade_s <= 0.0:
        return 1.0
    return min(max((now - since) / fade_s, 0.0), 1.0)


def _parsed(payload: bytes) -> ShowState:
    """A show state of another version of this program keeps what both know."""
    try:
        values: dict[str, Any] = plain_json(payload)
        parts = values.get("dance", {}).items()
        values["dance"] = {name: (number, text, tuple(given)) for name, (number, text, given) in parts}
        return ShowState(**{name: value for name, value in values.items() if name in _FIELDS})
    except (ValueError, TypeError, AttributeError):
        return ShowState()
