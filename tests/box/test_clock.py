"""The grid keeps its place whatever a tick or a sleep costs."""

from __future__ import annotations

import random

import pytest

from appliance.box.clock import TICK_S, TickClock
from tests.fake_clock import FakeTime


def clock_on(time: FakeTime) -> TickClock:
    return TickClock(monotonic=time.monotonic, sleep=time.sleep)


def test_ticks_stand_on_the_grid_although_every_sleep_overshoots() -> None:
    noise = random.Random(1)
    time = FakeTime(lambda: noise.uniform(0.0, 0.004))
    clock = clock_on(time)
    for tick in range(500):
        slot = clock.wait()
        assert slot.tick == tick
        assert slot.skipped == 0
        assert slot.deadline == pytest.approx(1000.0 + (tick + 1) * TICK_S)
        assert 0.0 <= slot.lateness_s <= 0.004 + 1e-9
        time.work(noise.uniform(0.0, 0.015))


def test_the_first_slot_is_due_when_all_is_ready() -> None:
    time = FakeTime()
    clock = clock_on(time)
    time.work(0.3)  # opening ports, sharing the frame
    clock.begin(0.004)
    slot = clock.wait()
    assert (slot.tick, slot.skipped) == (0, 0)
    assert slot.deadline == slot.started == pytest.approx(1000.304)
    assert clock.wait().deadline == pytest.approx(1000.304 + TICK_S)


def test_a_long_tick_skips_slots_and_is_never_followed_by_a_burst() -> None:
    time = FakeTime()
    clock = clock_on(time)
    clock.wait()
    time.work(0.095)  # 4.75 periods
    slot = clock.wait()
    assert (slot.tick, slot.skipped) == (4, 3)
    assert slot.lateness_s == pytest.approx(0.015)
    slot = clock.wait()
    assert (slot.tick, slot.skipped) == (5, 0)
    assert slot.deadline == pytest.approx(1000.0 + 6 * TICK_S)
    assert slot.lateness_s == pytest.approx(0.0)


def test_a_sleep_that_overshoots_by_several_slots_wakes_in_the_newest_one() -> None:
    overshoots = iter([0.0, 0.133, 0.0])
    time = FakeTime(lambda: next(overshoots))
    clock = clock_on(time)
    clock.wait()
    slot = clock.wait()
    assert (slot.tick, slot.skipped) == (7, 6)
    assert slot.lateness_s == pytest.approx(0.013)
    assert clock.wait().lateness_s == pytest.approx(0.0)


def test_a_tick_that_ends_exactly_at_the_next_deadline_skips_nothing() -> None:
    time = FakeTime()
    clock = clock_on(time)
    clock.wait()
    time.work(TICK_S)
    slot = clock.wait()
    assert (slot.tick, slot.skipped) == (1, 0)


def test_a_shift_moves_this_deadline_and_all_after_it() -> None:
    time = FakeTime()
    clock = clock_on(time)
    first = clock.wait().deadline
    assert clock.wait(0.0002).deadline == pytest.approx(first + TICK_S + 0.0002)
    assert clock.wait().deadline == pytest.approx(first + 2 * TICK_S + 0.0002)


def test_the_machine_suspended_for_a_minute_costs_slots_and_nothing_else() -> None:
    time = FakeTime()
    clock = clock_on(time)
    clock.wait()
    time.work(60.0)
    slot = clock.wait()
    assert slot.skipped == 2999
    assert clock.wait().skipped == 0


def test_the_warm_up_comes_before_the_deadline_and_the_tick_stays_on_it() -> None:
    time = FakeTime()
    clock = clock_on(time)
    warmed: list[float] = []

    def warm_up() -> None:
        warmed.append(time.now)
        time.work(0.0004)

    slot = clock.wait(lead_s=0.001, warm_up=warm_up)
    assert warmed == [pytest.approx(1000.0 + TICK_S - 0.001)]
    assert slot.started == pytest.approx(1000.0 + TICK_S)


def test_no_warm_up_when_its_moment_is_over() -> None:
    time = FakeTime()
    clock = clock_on(time)
    clock.wait()
    time.work(TICK_S - 0.0005)
    warmed: list[float] = []
    slot = clock.wait(lead_s=0.001, warm_up=lambda: warmed.append(time.now))
    assert not warmed
    assert slot.lateness_s == pytest.approx(0.0)
