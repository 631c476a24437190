"""Fallbacks: what a process does instead when something goes wrong: a name, a counter, a message."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

_LEAST_FIELDS = 4  # a process of an earlier release
RECENT_S = 5.0  # what happens at one moment counts as in force for this long


class Fallback(NamedTuple):
    """name: for desks and scripts; message: what happened, what the audience sees, what to do.

    named: the same where it is known what it concerns, in the place of `{about}`.
    """

    name: str
    message: str
    named: str = ""


class Fallen(NamedTuple):
    """The state of one fallback. times: how often since the process began; active: it is in force now.

    about: the names of what it concerns (sensors, receivers, wires, a disk), "" where that is not known.
    """

    name: str
    times: int
    active: bool
    message: str
    about: str = ""


class _Tally:
    """The counter of one fallback; a tick touches it without making anything."""

    __slots__ = ("about", "active", "complaint", "count", "fallback", "recent_until")

    def __init__(self, fallback: Fallback) -> None:
        self.fallback, self.complaint, self.about = fallback, "", ""
        self.count, self.active, self.recent_until = 0, False, 0.0

    @property
    def message(self) -> str:
        usual, named = self.fallback.message, self.fallback.named
        return self.complaint or (named.format(about=self.about) if self.about and named else usual)


class Fallbacks:
    """All fallbacks of one process. Names that it does not have raise KeyError: they are a programmer's.

    parts: what hangs on the process, by name, and why it is away; "" for what is there.
    """

    def __init__(self, known: Iterable[Fallback]) -> None:
        self._tallies = {one.name: _Tally(one) for one in known}
        self.parts: Mapping[str, str] = {}

    def count(self, name: str, now: float, times: int = 1) -> None:
        """It happened just now; monotonic seconds."""
        tally = self._tallies[name]
        tally.count += times
        tally.recent_until = now + RECENT_S

    def follow(self, name: str, total: int, now: float) -> None:
        """The same from a counter that is kept elsewhere."""
        if (times := total - self._tallies[name].count) > 0:
            self.count(name, now, times)

    def set(self, name: str, complaint: bool | str) -> None:
        """In force from now on, or over ("", False); a sentence replaces the usual message. Counts starts."""
        tally = self._tallies[name]
        tally.count += bool(complaint) and not tally.active
        tally.active = bool(complaint)
        if complaint:
            tally.complaint = complaint if isinstance(complaint, str) else ""

    def concern(self, name: str, things: Iterable[str]) -> None:
        """Its subject, by name. Without any, it is about the same as before."""
        if about := ", ".join(things):
            self._tallies[name].about = about

    def hold(self, name: str, active: bool) -> None:
        """Whether it is in force for longer than its moment; not counted again."""
        self._tallies[name].active = active

    def happened(self, now: float) -> list[Fallen]:
        """Those that ever happened, in their order."""
        return [
            Fallen(name, one.count, one.active or now < one.recent_until, one.message, one.about)
            for name, one in self._tallies.items()
            if one.count
        ]

    def line(self, now: float) -> str:
        """The names of those in force, for the status line; "" on a good night."""
        names = [one.name for one in self.happened(now) if one.active]
        return f"fallbacks: {', '.join(names)}" if names else ""


def fallen(values: Any) -> tuple[Fallen, ...]:
    """From JSON, as `happened` gave them; anything else is left out."""
    found = []
    for value in values if isinstance(values, list) else ():
        if isinstance(value, list) and len(value) in (_LEAST_FIELDS, len(Fallen._fields)):
            name, times, active, message, *about = value
            found.append(Fallen(str(name), int(times), bool(active), str(message), *map(str, about)))
    return tuple(found)
