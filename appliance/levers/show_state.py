"""The show state: where show control wants each lever. All processes read it and follow."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Generic, NamedTuple, TypeVar

from appliance.levers.fade import Fade
from appliance.levers.lever import Lever, at_once
from appliance.levers.table import CUE, GOING, LEVERS, MASTER, find_lever
from appliance.pose.foreign_file import plain_json

T = TypeVar("T")


class Change(NamedTuple, Generic[T]):
    """A lever goes to a value in so many seconds."""

    lever: Lever[T]
    value: T
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class ShowState:
    """All that show control has declared; times are monotonic seconds of this machine, names are the show's.

    `state[LOOK]` is the fade of a lever, which runs by itself: readers pass the time at which they draw.
    settings: the levers that were set, the newest last. generation: the newest that declared something for
    the dance, in nanoseconds since the machine started. A stage with another show than `show` follows
    nothing.
    """

    panic: bool = False
    blackout: bool = False
    show: str = ""
    generation: int = 0
    settings: Mapping[str, Fade[Any]] = field(default_factory=dict)

    def __getitem__(self, lever: Lever[T]) -> Fade[T]:
        return self.settings.get(lever.name, lever.at_rest)

    def __contains__(self, lever: Lever[Any]) -> bool:
        return lever.name in self.settings

    @property
    def going(self) -> bool:
        """False after /stop."""
        return self[GOING].value > 0.0

    @property
    def cue(self) -> str:
        """The newest; empty: none yet."""
        return self[CUE].value

    def level(self, now: float) -> float:
        """0..1: what dimmers and the picture are multiplied with."""
        if self.panic or self.blackout:
            return 0.0
        return self[MASTER].level(now) * self[GOING].level(now)

    def is_safe(self, now: float) -> bool:
        """Whether lights show their safe look: at once on panic, and when stopped as soon as it is dark."""
        return self.panic or self.stands(now)

    def stands(self, now: float) -> bool:
        """Whether the phrase stands still: stopped, and faded out."""
        return not self.going and self[GOING].level(now) <= 0.0

    def to(self, lever: Lever[T], value: T, now: float = 0.0, seconds: float = 0.0) -> ShowState:
        """One lever goes to a value."""
        return self.changed(now, [Change(lever, value, seconds)])

    def changed(self, now: float, changes: Iterable[Change[Any]]) -> ShowState:
        """Levers go to values, in one generation; what is set to the value that it has is followed anew."""
        number = max(self.generation + 1, int(1e9 * now))  # a new file never repeats an earlier number
        settings, generation = dict(self.settings), self.generation
        for lever, value, seconds in changes:
            for name in lever.ends:
                settings.pop(name, None)
            own = number if lever.follower else 0
            generation = max(generation, own)
            before = settings.pop(lever.name, lever.at_rest)  # behind the older ones
            settings[lever.name] = before.to(value, now, seconds, own)
        return replace(self, generation=generation, settings=settings)

    def for_show(self, show: str) -> ShowState:
        """Without what is of another show."""
        if show == self.show:
            return self
        stays = {one.name for one in LEVERS if one.stays}
        kept = {name: fade for name, fade in self.settings.items() if name in stays}
        return replace(self, show=show, settings=kept)

    def settled(self, now: float) -> ShowState:
        """With fades that began in the future done: the machine's clock has restarted since."""
        settings = {name: at_once(fade) if fade.since > now else fade for name, fade in self.settings.items()}
        return replace(self, settings=settings)


def packed(state: ShowState) -> bytes:
    values = {
        "panic": state.panic,
        "blackout": state.blackout,
        "show": state.show,
        "generation": state.generation,
        "settings": {
            name: (fade.value, fade.before, fade.since, fade.seconds, fade.generation)
            for name, fade in state.settings.items()
        },
    }
    return json.dumps(values, ensure_ascii=False).encode()


def unpacked(payload: bytes) -> ShowState:
    """From JSON. A show state of another release keeps what both know; foreign data is the default."""
    try:
        values = plain_json(payload)
        return ShowState(
            bool(values.get("panic")),
            bool(values.get("blackout")),
            str(values.get("show", "")),
            int(values.get("generation", 0)),
            dict(_settings(values["settings"] if "settings" in values else _of_before(values))),
        )
    except (ValueError, TypeError, AttributeError, KeyError):
        return ShowState()


def _settings(values: Mapping[str, Any]) -> Iterable[tuple[str, Fade[Any]]]:
    for name, (value, before, since, seconds, generation) in values.items():
        if (found := find_lever(name)) is not None:
            plain = found.kind.plain
            yield (
                name,
                Fade(plain(value), plain(before), float(since), float(seconds), int(generation)),
            )


def _of_before(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Settings in a show state of release 0.1, without their fades and without the dance."""
    names = [one.name for one in LEVERS if one.name in values]
    return {name: (values[name], values[name], 0.0, 0.0, 0) for name in names}
