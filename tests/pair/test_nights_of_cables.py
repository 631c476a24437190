"""Two boxes on a switch whose cables go out and come back, thousands of times; times are invented.

A card reports late that its cable is out, datagrams wait in the network until an address answers, a box is
held up. Even so two boxes never speak at once, the lead changes once at most, and in the end one box speaks.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from appliance.pair.carrier import Carrier
from appliance.pair.roles import Heard, Role, Roles

STEP_S, BEAT_STEPS, SILENT_S, STALE_S = 0.005, 4, 0.048, 0.1
OUT_S = (0.03, 0.06, 0.1, 0.2, 0.5, 0.8, 2.0, 4.0)
TELLS_AFTER_S = (0.0, 0.005, 0.02, 0.1, 0.4)
ASKS_AFTER_S = (0.0, 0.03, 0.09, 0.3, 0.9)  # until the network has found a box that was long away
LONG_S = 0.5


class Cable(Carrier):
    """One that is told what its card says."""

    def __init__(self, folder: Path) -> None:
        super().__init__(["10.77.0.9"], folder / "none", folder)
        self._cards = {folder / "carrier": (0, 0)}
        self._find_at = math.inf
        self.turn(True, 0.0)

    def turn(self, is_in: bool, now: float) -> None:
        (card,) = self._cards
        card.write_text(f"{is_in:d}\n")
        self.look(now)


@dataclass
class Box:
    roles: Roles
    cable: Cable
    out_until: float = 0.0
    told_at: float = 0.0
    found_at: float = 0.0  # when the network has its address again
    held_up_until: float = 0.0
    looked_at: float = 0.0
    came_after: float = -math.inf
    give_at: float = 0.0

    def look(self, came: list[tuple[float, Heard]], now: float) -> None:
        """As PairedStage does: the cable first, then what came, then the role. came: sent when, and what."""
        roles, cable = self.roles, self.cable
        reaches = cable.reaches(roles.role, now, roles.heard)
        if roles.leads and now >= self.give_at and cable.is_heard_nonetheless(now, self.came_after, {}):
            self.give_at = now + 1.0
            roles.give_back(now)
        for sent, heard in came:
            if now - sent < STALE_S + now - self.looked_at:
                as_of = sent if heard.role is Role.LEADS else math.inf
                roles.hear(heard._replace(as_of=as_of), now, True)
                self.came_after = self.looked_at
        self.looked_at = now
        roles.look(now, True, reaches)


@dataclass
class Night:
    rng: random.Random
    boxes: list[Box]
    steps: int = 0
    on_the_way: list[tuple[float, int, float, Heard]] = field(default_factory=list)  # arrives, to, sent
    both_s: float = 0.0

    @property
    def now(self) -> float:
        return STEP_S * self.steps

    def step(self) -> bool:
        """Whether a box speaks to the receivers."""
        self.steps += 1
        now, speak = self.now, 0
        for number, box in enumerate(self.boxes):
            is_out = now < box.out_until
            if is_out is box.cable.is_up and (not is_out or now >= box.told_at):
                box.cable.turn(not is_out, now)
            if now >= box.held_up_until:
                came = [
                    (sent, heard) for at, to, sent, heard in self.on_the_way if to == number and at <= now
                ]
                self.on_the_way = [one for one in self.on_the_way if one[1] != number or one[0] > now]
                box.look(came, now)
                if self.steps % BEAT_STEPS == 0 and not is_out:
                    self.beat(box.roles, 1 - number)
            speak += box.roles.leads and not is_out and box.cable.may_speak(now, box.roles.heard)
        self.both_s = self.both_s + STEP_S if speak > 1 else 0.0
        assert self.both_s <= 0.1, "two boxes speak"
        return speak > 0

    def beat(self, roles: Roles, to: int) -> None:
        """Two datagrams, which wait for a box that is away, or are lost."""
        for _ in range(2):
            if self.now >= self.boxes[to].out_until or self.rng.random() < 0.7:
                at = max(self.now, self.boxes[to].found_at) + self.rng.uniform(0.0, 0.015)
                self.on_the_way.append((at, to, self.now, Heard(roles.role, roles.epoch, True)))

    def pull(self, box: Box) -> None:
        gone = [one for one in self.on_the_way if self.boxes[one[1]] is box and one[0] > self.now]
        self.on_the_way = [one for one in self.on_the_way if one not in gone]
        out_s = self.rng.choice(OUT_S)
        box.out_until, box.told_at = self.now + out_s, self.now + self.rng.choice(TELLS_AFTER_S)
        box.found_at = box.out_until + self.rng.choice(ASKS_AFTER_S) * (out_s >= LONG_S)

    def fault(self, leader: Box, follower: Box) -> None:
        self.pull(self.rng.choice((leader, leader, follower)))
        if self.rng.random() < 0.25:
            self.pull(self.rng.choice((leader, follower)))
        if self.rng.random() < 0.3:
            self.rng.choice(self.boxes).held_up_until = self.now + self.rng.uniform(0.0, 0.045)


@pytest.mark.parametrize("seed", range(12))
def test_cables_that_go_out_and_come_back_leave_one_box_that_speaks(seed: int, tmp_path: Path) -> None:
    folders = tmp_path / "one", tmp_path / "two"
    for folder in folders:
        folder.mkdir()
    boxes = [Box(Roles(n == 0, 0.0, SILENT_S), Cable(folder)) for n, folder in enumerate(folders)]
    night = Night(random.Random(seed), boxes)
    for _ in range(200):
        night.step()
    for number in range(12):
        (leader,) = (box for box in boxes if box.roles.leads)
        (follower,) = (box for box in boxes if box is not leader)
        epoch = leader.roles.epoch
        night.fault(leader, follower)
        until = max(box.found_at for box in boxes) + 1.5
        while night.now < until:
            night.step()
        assert any(night.step() for _ in range(BEAT_STEPS)), f"fault {number}: nobody speaks"
        (leads,) = (box for box in boxes if box.roles.leads)
        assert leads.roles.epoch - epoch == (leads is not leader), f"fault {number}: the lead flapped"
