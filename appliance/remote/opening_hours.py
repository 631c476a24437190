"""Opening hours: whether the show runs now, when projectors warm up, and how loud the strings may be."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path
from zoneinfo import ZoneInfo

from appliance.show.opening_hours import DAYS, HoursConfig, holiday, minutes

_DAY = 24 * 60
_LAST_MINUTE_S = 60.0
_AHEAD_DAYS = 14
_BUILT_S = Path(__file__).stat().st_mtime  # an earlier time was never set


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
        """The clock on the wall, without its zone: hours are what people read there."""
        return datetime.datetime.fromtimestamp(now, self._zone).replace(tzinfo=None)
