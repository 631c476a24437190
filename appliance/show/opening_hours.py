"""box.yaml's opening hours: when the show runs without a person, and what is switched with it."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from typing import Annotated, Literal
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, Field, model_validator

from appliance.show.config_error import did_you_mean
from appliance.show.section import Ipv4, Section, key, refusal

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
Day = Literal["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
_CLOCK = re.compile(r"([01]?\d|2[0-3]):[0-5]\d|24:00")


def _clock(text: str) -> str:
    if _CLOCK.fullmatch(text) is None:
        raise refusal(f"'{text}' is no time of day.", 'Write it like "09:30", in quotes.')
    return text


def _holiday(text: str) -> str:
    try:
        first, last = holiday(text)
    except ValueError:
        raise refusal(
            f"'{text}' is no date.", 'Write "2026-12-24", or "2026-12-24 to 2027-01-06", in quotes.'
        ) from None
    if last < first:
        raise refusal(f"'{text}' ends before it begins.", "Exchange the dates.")
    return text


def _zone(name: str) -> str:
    try:
        ZoneInfo(name)
    except (ValueError, OSError, KeyError):
        raise refusal(f"There is no time zone '{name}'.", "Write one like Europe/Berlin.") from None
    return name


Clock = Annotated[str, AfterValidator(_clock)]
Holiday = Annotated[str, AfterValidator(_holiday)]
Name = Annotated[str, AfterValidator(str.strip)]


def minutes(clock: str) -> int:
    """Minutes since midnight."""
    hours, _, rest = clock.partition(":")
    return 60 * int(hours) + int(rest)


def holiday(text: str) -> tuple[datetime.date, datetime.date]:
    """First and last day. Raises ValueError."""
    first, _, last = text.partition(" to ")
    begin = datetime.date.fromisoformat(first.strip())
    return begin, datetime.date.fromisoformat(last.strip()) if last else begin


class OpenConfig(Section):
    """Days on which the show runs, and from when to when."""

    days: list[Day] = key("mon, tue, wed, thu, fri, sat, sun.", list(DAYS), length=(1, 7))
    from_: Clock = Field(alias="from", description="When it opens.")
    to: Clock = key("When it closes; earlier than `from`: on the next day.")


class QuietConfig(Section):
    """Hours in which the strings are quieter."""

    from_: Clock = Field(alias="from", description="When they begin.")
    to: Clock = key("When they end; earlier than `from`: on the next day.")
    strings: float = key("How loud the strings are then, 0 to 1.", 0.0, within=(0, 1))


class AttractConfig(Section):
    """A cue for the time in which nobody is there: no sensor sends, and no live dancer."""

    cue: Name = key("The cue that is called.", length=(1, 64))
    after_s: float = key("How long nobody has to be there.", 60.0, within=(1, 3600))
    back: Name | None = key("The cue that is called when somebody comes; null: the one before.", None)


class ProjectorPowerConfig(Section):
    """A projector that is switched by PJLink."""

    host: Ipv4 = key("Its IP address.")
    port: int = key("Its TCP port.", 4352, within=(1, 65535))
    password: str | None = key("Its PJLink password; null: none.", None, length=(1, 32))


class HoursConfig(Section):
    """Opening hours."""

    open: list[OpenConfig] = key("When the show runs.", length=(1, 28))
    closed: list[Holiday] = key(
        'Days on which it does not: dates like "2026-12-24", or "2026-12-24 to 2027-01-06".',
        [],
        length=(0, 200),
    )
    zone: Annotated[str, AfterValidator(_zone)] | None = key(
        "Time zone, like Europe/Berlin; null: the machine's.", None
    )
    open_cue: Name | None = key("The cue with which it opens; null: the show goes on where it stood.", None)
    close_cue: Name | None = key(
        "The cue that is called a minute before it closes; at the end the show stops. null: none.", None
    )
    warm_up_s: float = key("How long before it opens projectors are switched on.", 60.0, within=(0, 900))
    quiet: list[QuietConfig] = key("Hours in which the strings are quieter.", [], length=(0, 8))
    attract: AttractConfig | None = key("Dances while nobody is there; null: the same as ever.", None)
    projectors: list[ProjectorPowerConfig] = key("Projectors to switch on and off.", [], length=(0, 8))

    def unknown_cues(self, names: Sequence[str]) -> list[str]:
        """A sentence for each cue that it calls and that a show with these cues lacks."""
        attract = (self.attract.cue, self.attract.back) if self.attract is not None else ()
        called = dict.fromkeys(filter(None, (self.open_cue, self.close_cue, *attract)))
        return [
            f"The opening hours call the cue '{cue}', which this show does not have: nothing changes then. "
            f"{did_you_mean(cue, names)}"
            for cue in called
            if cue not in names
        ]

    @model_validator(mode="after")
    def _some_time(self) -> HoursConfig:
        for place, one in enumerate(self.open):
            if minutes(one.from_) == minutes(one.to):
                cure = "For the whole day: 00:00 to 24:00."
                raise refusal("It opens and closes at the same time.", cure, at=("open", place, "to"))
        return self
