"""SMPTE timecode: hours, minutes, seconds and frames at one of four rates (SMPTE ST 12-1)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

DAY_S = 24 * 3600.0
_ROUNDING = 1e-3  # share of a frame: one that begins now has begun
_TEXT = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})(?:[:;.](\d{2}))?")


class Rate(NamedTuple):
    """A frame rate. nominal: frames that are counted in a second; drops: two numbers are left out in each
    minute but every tenth, so that the label keeps to the clock.
    """

    name: str
    nominal: int
    per_second: float
    drops: bool = False


RATES = (  # in the order in which Art-Net and MIDI timecode number them
    Rate("24", 24, 24.0),
    Rate("25", 25, 25.0),
    Rate("29.97", 30, 30_000 / 1001, drops=True),
    Rate("30", 30, 30.0),
)
BY_NAME = {rate.name: rate for rate in RATES}


@dataclass(frozen=True, slots=True)
class Timecode:
    """One label. Raises ValueError for one that does not exist at its rate."""

    hours: int
    minutes: int
    seconds: int
    frames: int
    rate: Rate

    def __post_init__(self) -> None:
        bounds = (self.hours, 24), (self.minutes, 60), (self.seconds, 60), (self.frames, self.rate.nominal)
        if not all(0 <= number < limit for number, limit in bounds):
            raise ValueError(f"There is no timecode {self} at {self.rate.name} frames a second.")

    @property
    def count(self) -> int:
        """Frames since 00:00:00:00."""
        minutes = 60 * self.hours + self.minutes
        frames = (60 * minutes + self.seconds) * self.rate.nominal + self.frames
        return frames - 2 * (minutes - minutes // 10) if self.rate.drops else frames

    @property
    def time_s(self) -> float:
        """Seconds since 00:00:00:00, by the clock."""
        return self.count / self.rate.per_second

    def __str__(self) -> str:
        separator = ";" if self.rate.drops else ":"
        return f"{self.hours:02}:{self.minutes:02}:{self.seconds:02}{separator}{self.frames:02}"


def at(time_s: float, rate: Rate) -> Timecode:
    """The label of the frame that is shown at this time; the day begins anew after 24 hours."""
    count = int(time_s % DAY_S * rate.per_second + _ROUNDING)
    if rate.drops:
        ten_minutes, rest = divmod(count, 17_982)  # ten minutes hold nine times two frames less than 18,000
        count += 18 * ten_minutes + 2 * max((rest - 2) // 1798, 0)
    seconds, frames = divmod(count, rate.nominal)
    return Timecode(seconds // 3600 % 24, seconds // 60 % 60, seconds % 60, frames, rate)


def time_of(text: str, rate: Rate) -> float:
    """Seconds of a label as people write it: HH:MM:SS:FF, or without frames. Raises ValueError.

    Numbers that the rate leaves out, or does not have, are the next one that it has.
    """
    found = _TEXT.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"'{text}' is no timecode.")
    hours, minutes, seconds, frames = (int(part or 0) for part in found.groups())
    if hours > 23 or minutes > 59 or seconds > 59 or frames > 29:
        raise ValueError(f"'{text}' is no timecode: 23:59:59:29 is the greatest.")
    frames = min(frames, rate.nominal - 1)
    if rate.drops and frames < 2 and seconds == 0 and minutes % 10:
        frames = 2
    return Timecode(hours, minutes, seconds, frames, rate).time_s
