"""An evening: eight compiled wearables dance, one fault follows the other, and an attacker is at work.

`python -m tests.system.evening --picture out/evening.png` plays and draws it; the tests play and judge it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from hw_sim import motions
from hw_sim.firmware_library import State, Status
from tests.system.attacker import Attacker
from tests.system.lockstep import EPOCH_S, Accepted, Lockstep, LockstepSensor, lockstep

NAMES = ["left-wrist", "right-wrist", "left-elbow", "right-elbow", "head", "chest", "left-knee", "right-knee"]
# Constant trouble: shares of bus transactions, and of datagrams.
SMALL_TROUBLE = {"nack": 1e-3, "zero read": 3e-4, "torn read": 3e-4, "flipped bit": 3e-4, "loss": 4e-3}
LOOK_S = 0.1
TRIES_PER_LOOK = 20


class Act(NamedTuple):
    """An event at a time of the evening, in seconds; `sensor` None: for all."""

    at: float
    sensor: int | None
    label: str
    happen: Callable[[Lockstep], None]


class Look(NamedTuple):
    """The state of one wearable at one moment."""

    at: float
    state: State | None  # None: off
    accepted: int  # readings since the previous look


@dataclass
class Evening:
    """A record for the tests and the picture. Times are seconds since the evening began."""

    sensors: list[LockstepSensor]
    acts: list[Act]
    accepted: list[Accepted] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    attacks: Counter[str] = field(default_factory=Counter)
    looks: list[list[Look]] = field(default_factory=lambda: [[] for _ in NAMES])
    finals: list[Status] = field(default_factory=list)
    end: float = 0.0


def script() -> list[Act]:
    """The acts in order. All wearables dance all the time, each for well over 30 s."""

    def switch(sensor: int, is_on: bool) -> Callable[[Lockstep], None]:
        return lambda stage: stage.sensors[sensor].wearable.power(is_on)

    def fault(sensor: int, name: str) -> Callable[[Lockstep], None]:
        return lambda stage: stage.sensors[sensor].wearable.inject(name)

    def lose_access_point(stage: Lockstep) -> None:
        stage.access_point(False)
        stage.access_point(True, in_s=20.0)

    acts = [Act(0.5 * number, number, "power on", switch(number, True)) for number in range(len(NAMES))]
    acts += [
        Act(14.0, 0, "IMU browns out", fault(0, "brown-out")),
        Act(16.0, 1, "IMU falls into CONFIG mode", fault(1, "silent config")),
        Act(18.0, 2, "battery lost contact", switch(2, False)),
        Act(19.5, 2, "power on", switch(2, True)),
        Act(20.0, 3, "bus is stuck", fault(3, "stuck bus")),
        Act(22.0, 4, "battery lost contact", switch(4, False)),
        Act(22.1, 4, "power on", switch(4, True)),
        Act(24.0, 5, "IMU's fusion stops with an error", fault(5, "fusion error")),
        Act(26.0, 6, "battery lost contact", switch(6, False)),
        Act(31.0, 6, "power on", switch(6, True)),
        Act(28.0, 7, "IMU browns out", fault(7, "brown-out")),
        Act(40.0, None, "box is switched off", Lockstep.box_off),
        Act(42.0, None, "box is back", Lockstep.box_on),
        Act(43.0, 7, "IMU browns out", fault(7, "brown-out")),
        Act(55.0, None, "access point is gone", lose_access_point),
        Act(62.0, 3, "battery lost contact", switch(3, False)),
        Act(66.0, 3, "power on", switch(3, True)),
        Act(75.0, None, "access point is back", lambda stage: None),
        Act(100.0, None, "end", lambda stage: None),
    ]
    return sorted(acts, key=lambda act: act.at)


def play(seed: int = 1) -> Evening:
    """The whole evening."""
    with lockstep(NAMES, seed, lambda number: motions.dance(100 * seed + number)) as stage:
        evening = Evening(stage.sensors, script(), accepted=stage.accepted)
        attacker = Attacker(("127.0.0.1", stage.port), [one.address for one in stage.sensors], seed)
        stage.overheard = attacker.overhear
        stage.look = _watching(evening, stage, attacker)
        for sensor in stage.sensors:
            for trouble, share in SMALL_TROUBLE.items():
                sensor.wearable.set_trouble(trouble, share)
        stage.box_on()
        for act in evening.acts:
            stage.run(act.at - (stage.now - EPOCH_S))
            act.happen(stage)
        attacker.close()
        evening.end = stage.now - EPOCH_S
        evening.finals = [sensor.wearable.status for sensor in stage.sensors]
        stage.box_off()
        evening.counts, evening.attacks = stage.counts, attacker.counts
    return evening


def _watching(evening: Evening, stage: Lockstep, attacker: Attacker) -> Callable[[float], None]:
    """Sample every wearable each 0.1 s, and let the attacker act."""
    seen = 0
    next_look = stage.now

    def look(now: float) -> None:
        nonlocal seen, next_look
        if now < next_look:
            return
        next_look += LOOK_S
        attacker.act(TRIES_PER_LOOK)
        accepted = Counter(one.reading.sensor for one in stage.accepted[seen:])
        seen = len(stage.accepted)
        for sensor, looks in zip(stage.sensors, evening.looks, strict=True):
            looks.append(Look(now - EPOCH_S, sensor.state, accepted[sensor.key.name]))

    return look


def main() -> None:
    """Play, report, draw."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m tests.system.evening")
    parser.add_argument("--picture", type=Path, default=Path("out/evening.png"))
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    began = time.monotonic()
    evening = play(arguments.seed)
    took_s = time.monotonic() - began
    print(f"{len(evening.sensors)} wearables, {evening.end:g} s of virtual time in {took_s:.1f} s")
    print("box:", dict(sorted((word, count) for word, count in evening.counts.items() if count)))
    print("attacker:", dict(evening.attacks))
    from tests.system.evening_picture import draw_evening

    arguments.picture.parent.mkdir(parents=True, exist_ok=True)
    draw_evening(arguments.picture, evening)
    print(arguments.picture)


if __name__ == "__main__":
    sys.exit(main())
