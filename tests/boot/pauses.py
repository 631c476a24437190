"""What a receiver saw of the dance, and how long it saw nothing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

FPS = 50.0


class Seen(NamedTuple):
    """A frame as it came in. `at`: seconds since 1970, from the kernel; root: x and z in metres."""

    at: float
    tick: int
    sequence: int  # of the sensor's reading in it, -1: none
    late: bool
    root: tuple[float, float]


def pause_after(frames: Sequence[Seen], at: float) -> tuple[Seen, Seen] | None:
    """The last frame of the life that ended around `at`, the first one of the next; None: it goes on.

    However long a machine that is busy takes for it: each life of the stage counts its ticks from 0.
    """
    for before, after in pairwise(frames):
        if after.at > at and after.tick <= before.tick:
            return before, after
    return None


def share(frames: Sequence[Seen], since: float, until: float) -> float:
    """How many of the frames of this time came in: near 1 when it danced, near 0 when it waited."""
    return sum(since < one.at < until for one in frames) / (FPS * (until - since))


def longest_pause_s(frames: Sequence[Seen]) -> float:
    """Between two frames that came one after the other."""
    return max((after.at - before.at for before, after in pairwise(frames)), default=0.0)


def missing_ticks(frames: Sequence[Seen]) -> int:
    """How many ticks of one and the same life of the stage did not come in."""
    return sum(max(0, after.tick - before.tick - 1) for before, after in pairwise(frames))


def lives(frames: Sequence[Seen]) -> int:
    """In how many lives of the stage these frames were danced: each counts its ticks from 0."""
    return 1 + sum(after.tick <= before.tick for before, after in pairwise(frames))


def step_m(one: Seen, other: Seen) -> float:
    """How far the dancer stands from where she stood."""
    (x, z), (other_x, other_z) = one.root, other.root
    return float(((x - other_x) ** 2 + (z - other_z) ** 2) ** 0.5)
