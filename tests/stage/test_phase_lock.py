"""The tick settles just after the sensor's usual arrival, slowly, and stays there."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from appliance.box.clock import TICK_S, TickClock
from appliance.stage.phase_lock import PhaseLock
from tests.fake_clock import FakeTime


@dataclass
class Venue:
    """Readings of a wearable over Wi-Fi, on its own clock: jitter, gaps of 105-245 ms, bursts after them."""

    seed: int = 0
    phase_s: float = 0.0
    drift: float = 0.0
    jitter_s: float = 0.0008
    gap_every: int = 0
    silent: tuple[float, float] = (1e9, 1e9)
    random: random.Random = field(init=False)

    def arrivals(self) -> Iterator[float]:
        self.random = random.Random(self.seed)
        blocked_until, number, last = 0.0, 0, 0.0
        while True:
            number += 1
            sent = 1000.0 + self.phase_s + number * TICK_S * (1.0 + self.drift)
            if self.gap_every and number % self.gap_every == 0:
                blocked_until = sent + self.random.uniform(0.105, 0.245)
            last = max(last, sent + self.random.expovariate(1.0 / self.jitter_s), blocked_until) + 1e-5
            if not self.silent[0] <= last - 1000.0 < self.silent[1]:
                yield last


@dataclass
class Run:
    """A run of the clock under the lock: what each tick saw."""

    periods: list[float]
    waits: list[float]  # of the newest reading at each tick, seconds
    locked: list[bool]


def run(venue: Venue, seconds: float, lock: PhaseLock | None = None) -> Run:
    time = FakeTime()
    clock = TickClock(monotonic=time.monotonic, sleep=time.sleep)
    lock = lock or PhaseLock()
    arrivals = venue.arrivals()
    upcoming = next(arrivals)
    seen, last_deadline, shift = Run([], [], []), None, 0.0
    while time.now < 1000.0 + seconds:
        slot = clock.wait(shift)
        newest = None
        while upcoming <= time.now:
            newest = upcoming
            lock.observe(upcoming)
            upcoming = next(arrivals)
        if newest is not None:
            seen.waits.append(time.now - newest)
        shift = lock.shift_s(slot.deadline)
        if last_deadline is not None:
            seen.periods.append(slot.deadline - last_deadline)
        last_deadline = slot.deadline
        seen.locked.append(lock.locked)
        time.work(0.002)
    return seen


def median_ms(values: list[float]) -> float:
    return 1000.0 * sorted(values)[len(values) // 2]


@pytest.mark.parametrize("phase_s", [0.001, 0.006, 0.0105, 0.0155, 0.0195])
def test_settles_from_any_offset_and_most_readings_hardly_wait(phase_s: float) -> None:
    settled = run(Venue(seed=3, phase_s=phase_s, gap_every=200), 20.0)
    waits = settled.waits[400:]
    assert median_ms(waits) < 1.3
    assert sum(wait < 0.005 for wait in waits) > 0.7 * len(waits)
    assert all(settled.locked[400:])


def test_free_running_waits_a_half_period_on_average_over_offsets() -> None:
    free = PhaseLock(gain=0.0)
    waits = [median_ms(run(Venue(seed=4, phase_s=step * 0.002), 4.0, free).waits) for step in range(10)]
    assert 8.0 < sum(waits) / len(waits) < 12.0


def test_no_period_leaves_the_bound_whatever_arrives() -> None:
    worst = run(Venue(seed=5, phase_s=0.01, jitter_s=0.006, gap_every=7, drift=200e-6), 20.0)
    assert max(abs(period - TICK_S) for period in worst.periods) <= 0.0002 + 1e-9


@pytest.mark.parametrize("drift", [200e-6, -200e-6])
def test_follows_a_drifting_clock(drift: float) -> None:
    followed = run(Venue(seed=6, phase_s=0.004, drift=drift, gap_every=200), 60.0)
    assert median_ms(followed.waits[500:]) < 1.5
    assert sum(followed.periods[-1000:]) / 1000 == pytest.approx(TICK_S * (1.0 + drift), abs=1e-6)


def test_two_readings_a_tick_are_followed_in_their_period() -> None:
    """Ticks come just after every second arrival, whichever that is."""
    lock = PhaseLock(TICK_S / 2)
    for number in range(600):
        lock.observe(5.0 + 0.0043 + number * TICK_S / 2)
    deadline, waits = 11.0, []
    for _ in range(200):
        deadline += TICK_S + lock.shift_s(deadline)
        waits.append((deadline - 5.0043) % (TICK_S / 2))
    assert waits[-1] < 0.001
    assert lock.locked


def test_holds_its_place_through_a_dropout_and_is_there_when_readings_return() -> None:
    lock = PhaseLock()
    through = run(Venue(seed=7, phase_s=0.012, silent=(10.0, 13.0)), 20.0, lock)
    assert len(through.waits) < 19 * 50
    assert median_ms(through.waits[-200:]) < 1.3
    assert lock.locked


def test_without_a_sensor_the_grid_is_free() -> None:
    lock = PhaseLock()
    assert [lock.shift_s(20.0 + tick * TICK_S) for tick in range(5)] == [0.0] * 5
    assert not lock.locked


def test_a_few_arrivals_move_nothing_yet() -> None:
    lock = PhaseLock()
    for number in range(10):
        lock.observe(5.0 + number * TICK_S)
    assert lock.shift_s(5.21) == 0.0


def test_a_sensor_that_fell_silent_for_good_is_forgotten() -> None:
    lock = PhaseLock()
    for number in range(64):
        lock.observe(5.0 + number * TICK_S)
    assert lock.shift_s(6.29) != 0.0
    lock.forget()
    assert lock.shift_s(6.31) == 0.0
