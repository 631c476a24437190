"""The caretaker: opens and closes the show, switches projectors, and calls a cue while nobody is there."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.record import WholeFile
from appliance.levers.show_state import ShowState
from appliance.levers.table import STRINGS
from appliance.pose.foreign_file import plain_json
from appliance.remote.opening_hours import OpeningHours, is_set
from appliance.remote.pjlink import ProjectorPower
from appliance.show.opening_hours import HoursConfig
from appliance.show_control.packet import Message

FILE = "opening-hours"
_LARGEST = 1024
_LOOK_S = 1.0
_FADE_S = 5.0  # for the strings


class Memory(NamedTuple):
    """Outlives the process, not the power: what it did last stays done, and what people did since too.

    is_open: whether it opened or closed, None: neither yet; stands: the show has stopped since; ends: the cue
    of the end was called.
    loud: the strings before the quiet hours, None outside of them. before: the cue before nobody was there.
    """

    is_open: bool | None = None
    stands: bool = False
    ends: bool = False
    loud: float | None = None
    before: str | None = None


class Caretaker:
    """Gives commands where the hours change; what people do in between counts until the next change."""

    def __init__(
        self, config: HoursConfig, folder: Path, give: Callable[[Message], None], wall: Callable[[], float]
    ) -> None:
        self._config, self._give, self._wall = config, give, wall
        self._hours = OpeningHours(config)
        self._file = WholeFile(folder / FILE, _LARGEST)
        self._memory = self._noted = _read(self._file)
        self.projectors = [ProjectorPower(one.host, one.port, one.password) for one in config.projectors]
        self._look_at = 0.0
        self._somebody_at: float | None = None
        self._reported: dict[str, Any] = {}

    def turn(self, state: ShowState, health: Mapping[str, Any], live: str, now: float) -> None:
        """Once a second: give what is due. live: how much of a live dancer comes, "" for none."""
        if now < self._look_at:
            return
        self._look_at = now + _LOOK_S
        wall = self._wall()
        self._open_and_close(state, wall)
        self._quieten(state, wall)
        if self._config.attract is not None:
            self._attract(state, _anybody(health) or bool(live), now)
        for projector in self.projectors:
            projector.want(self._hours.is_warm(wall))
        self._reported = {"open": self._hours.is_open(wall), "next": self._hours.next_change(wall)}
        if self._memory != self._noted:
            self._noted = self._memory
            _write(self._file, self._memory)

    def report(self) -> dict[str, Any]:
        """For the page; from the first turn on."""
        projectors = [{"host": one.host, **one.seen._asdict()} for one in self.projectors]
        return {**self._reported, "projectors": projectors}

    def troubles(self) -> list[str]:
        """A clause about each projector that is not as it should be."""
        return [f"{one.host} {one.seen.trouble}" for one in self.projectors if one.seen.trouble]

    @property
    def knows_the_time(self) -> bool:
        """Whether the clock was ever set."""
        return is_set(self._wall())

    def close(self) -> None:
        """Leave everything as it is."""
        for projector in self.projectors:
            projector.close()

    def _open_and_close(self, state: ShowState, wall: float) -> None:
        is_open, before = self._hours.is_open(wall), self._memory.is_open
        if is_open != before:
            self._memory = self._memory._replace(is_open=is_open, stands=False, ends=False)
            if is_open and before is not None and not state.panic:  # at power-on the show runs already
                self._give(("/go",))
                if self._config.open_cue:
                    self._give(("/cue", self._config.open_cue))
        elif not is_open and not self._memory.stands:  # again, until show control is there to hear it
            self._memory = self._memory._replace(stands=not state.going)
            if state.going:
                self._give(("/stop",))
        elif self._hours.closes_soon(wall) and not self._memory.ends:
            self._memory = self._memory._replace(ends=True)
            if self._config.close_cue:
                self._give(("/cue", self._config.close_cue))

    def _quieten(self, state: ShowState, wall: float) -> None:
        most, loud = self._hours.strings(wall), self._memory.loud
        if most < 1.0 and loud is None:
            self._memory = self._memory._replace(loud=state[STRINGS].value)
            self._give(("/strings", min(most, state[STRINGS].value), _FADE_S))
        elif most == 1.0 and loud is not None:
            self._memory = self._memory._replace(loud=None)
            self._give(("/strings", loud, _FADE_S))

    def _attract(self, state: ShowState, somebody: bool, now: float) -> None:
        attract = self._config.attract
        assert attract is not None
        if somebody or self._somebody_at is None:
            self._somebody_at = now
        before = self._memory.before
        if somebody and before is not None:
            self._memory = self._memory._replace(before=None)
            if state.cue == attract.cue and (back := attract.back or before):
                self._give(("/cue", back))
        elif before is None and state.going and now - self._somebody_at >= attract.after_s:
            self._memory = self._memory._replace(before=state.cue)
            self._give(("/cue", attract.cue))


def _anybody(health: Mapping[str, Any]) -> bool:
    """Whether a sensor sends: a line of the roster has its state."""
    lines: Iterable[Any] = health.get("sensors") or ()
    return any("linked" in line for line in lines if isinstance(line, list))


def _read(file: WholeFile) -> Memory:
    try:
        return Memory(**plain_json(file.read()[0]))
    except (OSError, ValueError, IndexError, TypeError):
        return Memory()


def _write(file: WholeFile, memory: Memory) -> None:
    try:
        file.write(json.dumps(memory._asdict()).encode())
    except OSError:  # without it a restarted process gives its last command once more
        return
