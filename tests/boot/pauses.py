"""What a receiver saw of the dance, and how long it saw nothing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

PAUSE_S = 0.1  # five ticks: what is longer than that is no jitter


class Seen(NamedTuple):
    """A frame as it came in. `at`: seconds since 1970, from the kernel; root: x and z in metres."""

    at: float
    tick: int
    sequence: int  # of the sensor's reading in it, -1: none
    late: bool
    root: tuple[float, float]


def pause_after(frames: Sequence[Seen], at: float) -> tuple[Seen, Seen] | None:
    """The frames around the first pause that begins or lasts after `at`; None when there was none."""
    for before, after in pairwise(frames):
        if after.at > at and after.at - before.at > PAUSE_S:
            return before, after
    return None


def longest_pause_s(frames: Sequence[Seen]) -> float:
    """Between two frames that came one after the other."""
    return max((after.at - before.at for before, after in pairwise(frames)), default=0.0)


def missing_ticks(frames: Sequence[Seen]) -> int:
    """How many ticks of one and the same life of the stage did not come in."""
    return sum(max(0, after.tick - before.tick - 1) for before, after in pairwise(frames))


def lives(frames: Sequence[Seen]) -> int:
    """In how many lives of the stage these frames were danced: each counts its ticks anew."""
    return 1 + sum(after.tick <= before.tick for before, after in pairwise(frames))


def step_m(one: Seen, other: Seen) -> float:
    """How far the dancer stands from where she stood."""
    (x, z), (other_x, other_z) = one.root, other.root
    return float(((x - other_x) ** 2 + (z - other_z) ** 2) ** 0.5)
