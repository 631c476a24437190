"""The caretaker: opens and closes the show, switches projectors, and calls a cue while nobody is there."""

from __future__ import annotations

import datetime
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zoneinfo import ZoneInfo

from appliance.box.record import WholeFile
from appliance.box.roster import Roster
from appliance.levers.show_state import ShowState
from appliance.levers.table import STRINGS
from appliance.pose.foreign_file import plain_json
from appliance.remote.pjlink import ProjectorPower
from appliance.show.opening_hours import DAYS, HoursConfig, holiday, minutes
from appliance.show_control.packet import Message

_DAY = 24 * 60
_LAST_MINUTE_S = 60.0
_AHEAD_DAYS = 14
_BUILT_S = Path(__file__).stat().st_mtime  # an earlier time was never set

FILE = "opening-hours"
_LARGEST = 1024
_LOOK_S = 1.0
_FADE_S = 5.0  # for the strings
_TRIES = 10  # once a second: show control has started again by then; one that refuses is not asked for ever


class Memory(NamedTuple):
    """Outlives the process, not the power: what it did last stays done, and what people did since too.

    is_open: whether it opened or closed, None: neither yet; goes: how often /go may still be given until the
    show goes; stands: the show has stopped since; ends: the cue of the end was called.
    loud: the strings before the quiet hours, None outside of them. fades: from which strings to which, how
    often that may still be given until they have changed. calls: the same of a cue.
    before: the cue before nobody was there.
    """

    is_open: bool | None = None
    goes: int = 0
    stands: bool = False
    ends: bool = False
    loud: float | None = None
    fades: Sequence[float] = ()
    calls: Sequence[Any] = ()
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
        wall, called = self._wall(), self._memory.calls
        self._open_and_close(state, wall)
        self._quieten(state, wall)
        if self._config.attract is not None:
            self._attract(state, _anybody(health) or bool(live), now)
        if called and self._memory.calls is called:
            self._call_again(state)
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
            goes = is_open and before is not None and not state.panic  # at power-on the show runs already
            self._memory = self._memory._replace(
                is_open=is_open, goes=_TRIES * goes, stands=False, ends=False
            )
            if is_open:
                self._watch_anew(state)
            if goes:
                self._go(state)
        elif self._memory.goes and (state.going or state.panic):
            self._memory = self._memory._replace(goes=0)
        elif self._memory.goes:  # again, until show control is there to hear it
            self._go(state)
        elif not is_open and not self._memory.stands:  # again too
            self._memory = self._memory._replace(stands=not state.going)
            if state.going:
                self._give(("/stop",))
        elif self._hours.closes_soon(wall) and not self._memory.ends:
            self._memory = self._memory._replace(ends=True)
            if self._config.close_cue:
                self._call(self._config.close_cue, state)

    def _go(self, state: ShowState) -> None:
        first = self._memory.goes == _TRIES
        self._memory = self._memory._replace(goes=self._memory.goes - 1)
        self._give(("/go",))
        if self._config.open_cue and first:
            self._call(self._config.open_cue, state)

    def _call(self, cue: str, state: ShowState) -> None:
        self._memory = self._memory._replace(calls=[cue, state.cue, _TRIES - 1])
        self._give(("/cue", cue))

    def _call_again(self, state: ShowState) -> None:
        """Until another cue is in force: show control may have been away."""
        cue, before, left = self._memory.calls
        if left and before == state.cue != cue:
            self._memory = self._memory._replace(calls=[cue, before, left - 1])
            self._give(("/cue", cue))
        else:
            self._memory = self._memory._replace(calls=[])

    def _watch_anew(self, state: ShowState) -> None:
        """A new day: nobody was missed yet, and yesterday's cue only counts while its stand-in is there."""
        self._somebody_at = None
        attract = self._config.attract
        if attract is not None and (self._config.open_cue or state.cue) != attract.cue:
            self._memory = self._memory._replace(before=None)

    def _quieten(self, state: ShowState, wall: float) -> None:
        most, loud, strings = self._hours.strings(wall), self._memory.loud, state[STRINGS].value
        if most < 1.0 and loud is None:
            self._memory = self._memory._replace(loud=strings, fades=[strings, min(most, strings), _TRIES])
        elif most == 1.0 and loud is not None:
            self._memory = self._memory._replace(loud=None, fades=[strings, loud, _TRIES])
        before, after, left = self._memory.fades or (strings, strings, 0)
        if left and before == strings != after:  # again, until it is heard
            self._memory = self._memory._replace(fades=[before, after, left - 1])
            self._give(("/strings", after, _FADE_S))
        elif self._memory.fades:
            self._memory = self._memory._replace(fades=[])

    def _attract(self, state: ShowState, somebody: bool, now: float) -> None:
        attract = self._config.attract
        assert attract is not None
        if somebody or self._somebody_at is None:
            self._somebody_at = now
        before = self._memory.before
        if somebody and before is not None:
            self._memory = self._memory._replace(before=None, calls=[])
            if state.cue == attract.cue and (back := attract.back or before):
                self._call(back, state)
        elif before is None and state.going and now - self._somebody_at >= attract.after_s:
            self._memory = self._memory._replace(before=state.cue)
            self._call(attract.cue, state)


def _anybody(health: Mapping[str, Any]) -> bool:
    """Whether a sensor sends."""
    return any(line.state == "linked" for line in Roster.reported(health).lines)


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


def is_set(now: float) -> bool:
    """Whether the machine's clock was ever set: it is later than this release. Unix seconds."""
    return now >= _BUILT_S


class OpeningHours:
    """All times are Unix seconds; the answers hold for the zone of the box file."""

    def __init__(self, config: HoursConfig) -> None:
        self._config = config
        self._zone = None if config.zone is None else ZoneInfo(config.zone)
        self._closed = [holiday(text) for text in config.closed]

    def is_open(self, now: float) -> bool:
        """Whether the show runs. A clock that was never set knows no hours: it runs."""
        if not is_set(now):
            return True
        moment = self._local(now)
        return any(begin <= moment < end for begin, end in self._openings(moment))

    def is_warm(self, now: float) -> bool:
        """Whether projectors are on: while it is open, and before."""
        return self.is_open(now) or self.is_open(now + self._config.warm_up_s)

    def closes_soon(self, now: float) -> bool:
        """Whether this is the last minute."""
        return self.is_open(now) and not self.is_open(now + _LAST_MINUTE_S)

    def strings(self, now: float) -> float:
        """How loud the strings may be, 0..1."""
        moment = self._local(now)
        minute = 60 * moment.hour + moment.minute
        found = [1.0]
        for one in self._config.quiet:
            begin, end = minutes(one.from_), minutes(one.to)
            if (begin <= minute < end) if begin < end else (minute >= begin or minute < end):
                found.append(one.strings)
        return min(found) if is_set(now) else 1.0

    def next_change(self, now: float) -> str:
        """When it opens or closes next, as the clock on the wall has it: `mon 18:00`; "" within a fortnight
        not.
        """
        moment = self._local(now)
        both = {end for ends in self._openings(moment, days=_AHEAD_DAYS) for end in ends if end > moment}
        was_open = any(begin <= moment < end for begin, end in self._openings(moment))
        for at in sorted(both):
            if was_open != any(begin <= at < end for begin, end in self._openings(at)):
                return f"{DAYS[at.weekday()]} {at:%H:%M}"
        return ""

    def _openings(
        self, moment: datetime.datetime, days: int = 0
    ) -> Iterator[tuple[datetime.datetime, datetime.datetime]]:
        """Openings of yesterday, which may reach into today, and of the days from today on. A day counts by
        when it opened.
        """
        for number in range(-1, days + 1):
            day = moment.date() + datetime.timedelta(days=number)
            if any(first <= day <= last for first, last in self._closed):
                continue
            for one in self._config.open:
                if DAYS[day.weekday()] in one.days:
                    begin, end = minutes(one.from_), minutes(one.to)
                    yield self._at(day, begin), self._at(day, end if end > begin else end + _DAY)

    def _at(self, day: datetime.date, minute: int) -> datetime.datetime:
        days, rest = divmod(minute, _DAY)
        clock = datetime.time(rest // 60, rest % 60)
        return datetime.datetime.combine(day + datetime.timedelta(days=days), clock)

    def _local(self, now: float) -> datetime.datetime:
        """The clock on the wall, without its zone: hours are what people read there.

        Where an hour comes twice, in autumn, all of the second one counts as the end of the first: so nothing
        opens, closes or falls quiet twice.
        """
        moment = datetime.datetime.fromtimestamp(now, self._zone).replace(tzinfo=None)
        return moment.replace(minute=59, second=59, fold=0) if moment.fold else moment
