"""The show state: whether the audience sees anything, how bright, in which look. All processes read it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from appliance.box.block import BlockReader, BlockWriter
from appliance.pose.foreign_file import plain_json

FILE, KIND = "show_state", "show_state"
LARGEST = 8192  # bytes; the longest names of a show fit, whatever they are written in


@dataclass(frozen=True, slots=True)
class ShowState:
    """What show control has set. Times are monotonic seconds of this machine; names are those of the show.

    look, lights: "" is the show's first. Fades run by themselves: readers ask with the moment that they draw.
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
    cue: str = ""  # the newest that was carried out; "": none yet

    def level(self, now: float) -> float:
        """0..1: what dimmers and the picture are multiplied with."""
        if self.panic or self.blackout:
            return 0.0
        return self.master_level(now) * self.going_level(now)

    def is_safe(self, now: float) -> bool:
        """Whether lights show their safe look: at once on panic, and when stopped as soon as it is dark."""
        return self.panic or (not self.going and self.going_level(now) <= 0.0)

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

    def settled(self, now: float) -> ShowState:
        """With fades that began in the future done: the machine's clock has started anew since."""
        late = max(self.going_since, self.master_since, self.look_since, self.lights_since) > now
        if not late:
            return self
        return replace(self, going_fade_s=0.0, master_fade_s=0.0, look_fade_s=0.0, lights_fade_s=0.0)


class ShowStateReader:
    """Reads the show state of a runtime folder; before one is written the defaults hold: the show runs.

    A file that is gone stays in force until another one is written: panic stays panic when the folder is
    emptied, and what is dark does not flash up while a box ends.
    """

    def __init__(self, folder: Path) -> None:
        self._block = BlockReader(folder / FILE, KIND)
        self._payload: bytes | None = None
        self._house = ShowState()

    def read(self) -> ShowState:
        """How the show state is now. Never waits, never raises."""
        payload = self._block.read()
        if payload is not None and payload != self._payload:
            self._payload, self._house = payload, _parsed(payload)
        return self._house

    def close(self) -> None:
        """Let go of the file."""
        self._block.close()


class ShowStateWriter:
    """Show control's end: the file outlives it, so that panic stays panic. Raises OSError without a place."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, LARGEST)

    def write(self, show_state: ShowState) -> None:
        """Publish; readers see it when they look next."""
        self._block.write(json.dumps(asdict(show_state)).encode())

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
    known = {one.name for one in fields(ShowState)}
    try:
        values: dict[str, Any] = plain_json(payload)
        return ShowState(**{name: value for name, value in values.items() if name in known})
    except (ValueError, TypeError, AttributeError):
        return ShowState()
