"""The timeline of a soak: load, sensors that fall silent, a bad network, guests, kills."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import NamedTuple

# A minute each, one after the other; the words go to stress-ng.
LOADS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("none", ()),
    ("processor", ("--cpu", "0")),
    ("memory", ("--vm", "1", "--vm-bytes", "128M", "--vm-keep")),
    ("disk", ("--hdd", "1", "--hdd-bytes", "64M")),
    ("all", ("--cpu", "1", "--vm", "1", "--vm-bytes", "64M", "--io", "1", "--switch", "1")),
)
COMPRESSED_BELOW_S = 300.0  # shorter runs have the same acts, sooner
LOAD_S, SENSORS_S, GUESTS_S, COMMAND_S, KILL_S = 60.0, 40.0, 9.0, 3.0, 100.0
KILLS_UNTIL = 0.5  # share of the run: no kills in the second half, so that memory can be compared


class Act(NamedTuple):
    """An event at a second of the run, with its target where there is a choice."""

    at: float
    kind: str  # load, network, outage, back, guest, command, kill
    which: str = ""


def script(seconds: float, companions: list[str], guests: int, seed: int, load: bool) -> list[Act]:
    """All acts of a run of `seconds`, in order. The same seed gives the same run."""
    pace = min(1.0, seconds / COMPRESSED_BELOW_S)
    rng = random.Random(f"soak {seed}")
    acts = [*_sensors(seconds, pace, rng), *_guests(seconds, pace, guests, rng)]
    acts += [Act(at, "command") for at in _each(COMMAND_S * pace, seconds)]
    acts += _kills(seconds, pace, companions, rng)
    if load:
        acts += [
            Act(at, "load", LOADS[number % len(LOADS)][0])
            for number, at in enumerate(_each(LOAD_S * pace, seconds, 0.0))
        ]
    return sorted(acts, key=lambda act: act.at)


def _sensors(seconds: float, pace: float, rng: random.Random) -> Iterator[Act]:
    """Outages of 0.2 to 8 s; and each fourth time another network, for which the sensors are off and on."""
    for number, at in enumerate(_each(SENSORS_S * pace, seconds)):
        if number % 4 == 1:
            yield Act(at, "network", "bad" if number % 8 == 1 else "venue")
        else:
            yield Act(at, "outage")
            yield Act(at + pace * rng.uniform(0.2, 8.0), "back")


def _guests(seconds: float, pace: float, guests: int, rng: random.Random) -> Iterator[Act]:
    """Receivers that come and go."""
    for at in _each(GUESTS_S * pace, seconds):
        yield Act(at + pace * rng.uniform(0.0, 5.0), "guest", str(rng.randrange(guests)))


def _kills(seconds: float, pace: float, companions: list[str], rng: random.Random) -> Iterator[Act]:
    """Each of them in turn, in an order that changes."""
    for number, at in enumerate(_each(KILL_S * pace, KILLS_UNTIL * seconds)):
        if number % len(companions) == 0:
            rng.shuffle(companions := list(companions))
        yield Act(at, "kill", companions[number % len(companions)])


def _each(every_s: float, until_s: float, first_s: float | None = None) -> Iterator[float]:
    at = every_s if first_s is None else first_s
    while at < until_s:
        yield at
        at += every_s
