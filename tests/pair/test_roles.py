"""Which box leads: by hand-made cases, and by thousands of random nights in which nothing may go wrong."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import pytest

from appliance.pair.roles import (
    CABLE,
    CABLE_S,
    FIRST_WAITS_S,
    MOST_PATIENCE_S,
    SECOND_WAITS_S,
    SHORT_S,
    UNREADY_WAITS_S,
    YIELDS_S,
    Heard,
    Role,
    Roles,
)

SILENT_S, TICK_S = 0.048, 0.02


def roles(is_first: bool = True, now: float = 0.0) -> Roles:
    return Roles(is_first, now, SILENT_S)


def leading(is_first: bool = True) -> Roles:
    one = roles(is_first)
    one.look(SECOND_WAITS_S, False)
    assert one.leads
    return one


def following(is_first: bool = False, epoch: int = 1, now: float = 0.0) -> Roles:
    one = roles(is_first, now)
    one.hear(Heard(Role.LEADS, epoch, True), now, True)
    assert one.role is Role.FOLLOWS
    return one


def test_the_first_box_leads_soon_and_the_second_one_leaves_it_time() -> None:
    first, second = roles(True), roles(False)
    for one in (first, second):
        one.look(FIRST_WAITS_S, False)
    assert first.leads and not second.leads
    second.look(SECOND_WAITS_S, False)
    assert second.leads


def test_a_box_that_comes_follows_the_one_that_leads() -> None:
    first = roles(True)
    first.hear(Heard(Role.LEADS, 7, True), 0.1, False)
    first.look(10.0 - 9.0, False)
    assert first.role is Role.FOLLOWS and first.epoch == 7


@pytest.mark.parametrize("ready", [True, False])
def test_a_follower_takes_over_once_the_leader_is_silent(ready: bool) -> None:
    second = following()
    patience = SILENT_S if ready else UNREADY_WAITS_S
    second.look(patience - 0.001, ready)
    assert not second.leads
    second.look(patience + 0.001, ready)
    assert second.leads and second.epoch == 2 and second.takeovers == 1


def test_of_two_leaders_the_one_that_took_over_last_goes_on() -> None:
    first, second = leading(), following(epoch=1)
    second.look(1.0, True)
    first.hear(Heard(second.role, second.epoch, True), 7.0, False)
    second.hear(Heard(Role.LEADS, 1, True), 7.0, False)
    assert second.leads and first.role is Role.FOLLOWS and first.epoch == 2


def test_of_two_leaders_at_the_start_the_first_box_goes_on() -> None:
    first, second = leading(True), leading(False)
    assert first.epoch == second.epoch
    first.hear(Heard(Role.LEADS, second.epoch, True), 7.0, True)
    second.hear(Heard(Role.LEADS, first.epoch, True), 7.0, True)
    assert first.leads and not second.leads


def test_the_lead_comes_back_by_hand_only() -> None:
    first, second = following(True, epoch=5), leading(False)
    second.epoch = 5
    for tick in range(500):  # the first box is there again, and stays a follower
        now = 10.0 + TICK_S * tick
        second.hear(Heard(first.role, first.epoch, True), now, True)
        first.hear(Heard(second.role, second.epoch, True), now, True)
        first.look(now, True), second.look(now, True)
    assert second.leads and first.role is Role.FOLLOWS
    assert second.give_back(20.0) and not second.leads
    first.hear(Heard(second.role, second.epoch, True), 20.001, True)
    second.hear(Heard(first.role, first.epoch, True), 20.002, True)
    assert first.leads and second.role is Role.FOLLOWS


def test_nothing_is_given_to_a_box_that_is_away_or_not_ready() -> None:
    one = leading()
    assert not one.give_back(7.0)
    one.hear(Heard(Role.FOLLOWS, 1, False), 7.0, True)
    assert not one.give_back(7.1)
    one.hear(Heard(Role.FOLLOWS, 1, True), 7.0, True)
    assert not one.give_back(9.0)


def test_a_lead_that_nobody_takes_is_taken_up_again() -> None:
    one = leading()
    one.hear(Heard(Role.FOLLOWS, 1, True), 7.0, True)
    assert one.give_back(7.1)
    one.look(7.1 + YIELDS_S + 0.001, True)
    assert one.leads


def test_a_box_that_reaches_nobody_does_not_take_its_lead_back_from_the_one_that_took_over() -> None:
    """Its question was lost with the cable; the other box has found out by the silence in the same moment."""
    first, second = leading(), following()
    first.hear(Heard(Role.FOLLOWS, 1, True), 7.0, True)
    assert first.give_back(7.05)
    first.look(7.05 + YIELDS_S + 0.001, True, reaches=False)
    second.look(7.2, True)
    assert first.leads and second.leads
    second.hear(Heard(Role.LEADS, first.epoch, True), 8.0, True)
    first.hear(Heard(Role.LEADS, second.epoch, True), 8.0, True)
    assert second.leads and not first.leads


def test_a_lead_that_was_short_makes_the_next_takeover_slower() -> None:
    one = following()
    one.look(1.0, True)
    one.hear(Heard(Role.LEADS, 9, True), 1.0 + SHORT_S / 2, True)
    assert one.role is Role.FOLLOWS and one.patience_s == SILENT_S + TICK_S
    one.look(60.0, False)
    assert one.patience_s == SILENT_S


def test_a_follower_whose_cable_is_out_leaves_the_lead_where_it_is() -> None:
    one = following(epoch=3)
    one.look(5.0, True, reaches=False)
    assert one.role is Role.FOLLOWS and one.epoch == 3


def test_a_follower_whose_cable_comes_back_takes_no_leader_for_silent_whose_datagram_was_held_up() -> None:
    """Datagrams wait in the network until an address answers, and come one after the other."""
    one = following(epoch=3)
    one.look(1.0, True, reaches=False)
    late_s = 0.09
    one.hear(Heard(Role.LEADS, 4, True, 1.002 - late_s), 1.002, True)
    one.look(1.002, True)
    assert one.role is Role.FOLLOWS
    one.hear(Heard(Role.LEADS, 4, True, 1.01), 1.02, True)
    one.look(1.057, True)
    assert one.role is Role.FOLLOWS
    one.look(1.059, True)
    assert one.leads, "the leader was heard, and is silent"


def test_a_follower_that_took_over_before_its_card_told_of_the_cable_steps_back() -> None:
    first, second = following(True, epoch=3), following(epoch=3)
    second.look(1.0, True)
    assert second.leads and second.epoch == 4
    second.look(1.0 + CABLE_S - 0.1, True, reaches=False)
    assert second.role is Role.FOLLOWS and second.epoch == 3 and second.why == CABLE
    first.look(1.0, True)  # it led long before
    first.look(1.0 + CABLE_S + 0.1, True, reaches=False)
    assert first.leads


def test_a_box_that_was_switched_on_without_a_cable_gives_way_to_any_leader() -> None:
    newcomer, other = roles(True), leading(False)
    newcomer.look(FIRST_WAITS_S, False, reaches=False)
    assert newcomer.leads and newcomer.epoch < other.epoch
    newcomer.hear(Heard(Role.LEADS, other.epoch, True), 9.0, False)
    other.hear(Heard(Role.LEADS, 0, True), 9.0, True)
    assert newcomer.role is Role.FOLLOWS and other.leads


@dataclass
class Night:
    """Two boxes and a way between them that loses, holds up and breaks; times are invented."""

    rng: random.Random
    now: float = 0.0
    boxes: list[Roles | None] = field(default_factory=lambda: [roles(True), roles(False)])
    stopped_until: list[float] = field(default_factory=lambda: [0.0, 0.0])
    cut_until: float = 0.0
    loss: float = 0.0
    on_the_way: list[tuple[float, int, Heard]] = field(default_factory=list)
    both_since: float | None = None
    longest_both_s: float = 0.0
    changes: int = 0
    spoken: float = 0.0  # when a box last spoke

    def step(self) -> None:
        """Five milliseconds."""
        self.now += 0.005
        due = [one for one in self.on_the_way if one[0] <= self.now]
        self.on_the_way = [one for one in self.on_the_way if one[0] > self.now]
        for _, to, heard in due:
            if (box := self.boxes[to]) is not None and self.stopped_until[to] <= self.now:
                box.hear(heard, self.now, True)
        speaking = 0
        for number, box in enumerate(self.boxes):
            if box is None or self.stopped_until[number] > self.now:
                continue
            before = box.leads
            box.look(self.now, True)
            self.changes += box.leads != before
            speaking += box.leads
            if round(self.now / 0.005) % 4 == 0 and self.now >= self.cut_until:
                for _ in range(2):
                    if self.rng.random() >= self.loss:
                        at = self.now + self.rng.uniform(0.0, 0.006)
                        self.on_the_way.append((at, 1 - number, Heard(box.role, box.epoch, True)))
        if speaking:
            self.spoken = self.now
        together = speaking > 1 and self.now >= self.cut_until
        self.both_since = (self.both_since or self.now) if together else None
        if self.both_since is not None:
            self.longest_both_s = max(self.longest_both_s, self.now - self.both_since)

    def fault(self) -> None:
        """Anything."""
        kind, one = self.rng.randrange(6), self.rng.randrange(2)
        if kind == 0:
            self.boxes[one] = None
        elif kind == 1:
            self.stopped_until[one] = self.now + self.rng.uniform(0.0, 0.6)
        elif kind == 2:
            self.cut_until = self.now + self.rng.uniform(0.0, 0.4)
        elif kind == 3:
            self.loss = self.rng.choice((0.0, 0.05, 0.2))
        elif self.boxes[one] is None:
            self.boxes[one] = Roles(one == 0, self.now, SILENT_S)
        elif kind == 4 and (box := self.boxes[one]) is not None:
            box.give_back(self.now)


def test_in_thousands_of_random_nights_no_two_speak_together_and_one_always_comes_back() -> None:
    for seed in range(120):
        night = Night(random.Random(seed))
        for _ in range(12):
            night.fault()
            for _ in range(night.rng.randrange(4, 25)):
                night.step()
        night.loss, night.cut_until, night.stopped_until = 0.0, 0.0, [0.0, 0.0]
        night.boxes = [
            box or Roles(number == 0, night.now, SILENT_S) for number, box in enumerate(night.boxes)
        ]
        for _ in range(100):
            night.step()
        assert night.longest_both_s <= 0.1, f"night {seed}: two boxes spoke for {night.longest_both_s:.3f} s"
        changes = night.changes
        for _ in range(60):
            night.step()
            assert sum(box is not None and box.leads for box in night.boxes) == 1, f"night {seed}"
        assert night.changes == changes, f"night {seed}: the lead flaps"
        assert all(SILENT_S <= box.patience_s <= MOST_PATIENCE_S for box in night.boxes if box is not None)
