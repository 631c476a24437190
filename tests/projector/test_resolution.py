"""Pictures become smaller where a machine does not keep up, and larger again, slowly: on a fake clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appliance.projector.resolution import SHARES, Resolution

PERIOD_S = 1 / 60
Cost = Callable[[float], float]


class Machine:
    """Draws pictures that take as long as `cost` says for their share of the display's size."""

    def __init__(self, cost: Cost, adapts: bool = True) -> None:
        self.cost = cost
        self.resolution = Resolution(PERIOD_S, adapts)
        self.now = 100.0
        self.changes: list[tuple[float, float]] = []  # seconds since the start, share

    def dance(self, seconds: float, look: str | None = "plaster") -> float:
        """The share in the end."""
        end = self.now + seconds
        while self.now < end:
            took_s = self.cost(self.resolution.share)
            self.now += max(PERIOD_S, took_s)
            if self.resolution.note_picture(self.now, took_s, look):
                self.changes.append((self.now - 100.0, self.resolution.share))
        return self.resolution.share


def by_pixels(whole_s: float, fixed_s: float = 0.0) -> Cost:
    return lambda share: fixed_s + (whole_s - fixed_s) * share**2


def test_a_machine_that_keeps_up_shows_full_pictures() -> None:
    machine = Machine(by_pixels(0.9 * PERIOD_S))
    assert machine.dance(600) == 1.0
    assert not machine.changes


def test_one_that_does_not_shows_smaller_ones_within_seconds() -> None:
    machine = Machine(by_pixels(1.8 * PERIOD_S))
    assert machine.dance(4) == SHARES[1]
    assert machine.dance(600) == SHARES[1]
    slower = Machine(by_pixels(5 * PERIOD_S))
    assert slower.dance(6) == SHARES[2]
    assert [share for _, share in slower.changes] == [*SHARES[1:]]


def test_a_fixed_size_stays() -> None:
    machine = Machine(by_pixels(5 * PERIOD_S), adapts=False)
    assert machine.dance(60) == 1.0


def test_pictures_that_something_else_holds_up_do_not_count() -> None:
    random = np.random.default_rng(1)
    machine = Machine(lambda share: PERIOD_S * (4.0 if random.random() < 0.15 else 0.5))
    assert machine.dance(600) == 1.0


def test_larger_again_when_there_is_time_again_but_not_at_once() -> None:
    machine = Machine(by_pixels(1.8 * PERIOD_S))
    machine.dance(10)
    machine.cost = by_pixels(0.6 * PERIOD_S)
    assert machine.dance(15) == SHARES[1]
    assert machine.dance(15) == 1.0


def test_a_size_that_was_a_mistake_is_tried_ever_more_seldom() -> None:
    """A machine that is busy as soon as pictures are large."""
    machine = Machine(lambda share: PERIOD_S * (1.5 if share == 1.0 else 0.15))
    machine.dance(3600)
    tries = [at for at, share in machine.changes if share == 1.0]
    assert 3 <= len(tries) <= 9
    assert all(np.diff(tries) > 30) and tries[-1] - tries[-2] > 600


def test_never_while_looks_fade() -> None:
    machine = Machine(by_pixels(5 * PERIOD_S))
    assert machine.dance(30, None) == 1.0
    machine.dance(1)
    machine.dance(2, None)
    assert machine.dance(0.4) == 1.0
    assert machine.dance(5) == SHARES[2]


def test_no_blur_where_smaller_pictures_bring_nothing() -> None:
    machine = Machine(by_pixels(2.0 * PERIOD_S, fixed_s=1.95 * PERIOD_S))
    assert machine.dance(20) == 1.0
    assert [share for _, share in machine.changes] == [*SHARES[1:], 1.0]
    machine.dance(570)
    assert len(machine.changes) == 3
    machine.dance(60)
    assert len(machine.changes) == 6 and machine.resolution.share == 1.0


def test_full_pictures_that_were_measured_too_short_are_measured_again() -> None:
    """Another program started."""
    machine = Machine(by_pixels(1.5 * PERIOD_S, fixed_s=1.1 * PERIOD_S))
    machine.dance(1.2)
    assert machine.resolution.share == SHARES[1]
    machine.cost = by_pixels(2.0 * PERIOD_S, fixed_s=1.4 * PERIOD_S)
    machine.dance(20)
    assert [share for _, share in machine.changes] == [*SHARES[1:], 1.0, SHARES[-1]]
    machine.dance(300)
    assert len(machine.changes) == 4


def test_another_look_is_judged_again() -> None:
    machine = Machine(by_pixels(2.0 * PERIOD_S, fixed_s=1.95 * PERIOD_S))
    machine.dance(20, "cloud")
    machine.cost = by_pixels(5 * PERIOD_S)
    assert machine.dance(10, "plaster") == SHARES[2]
    machine.cost = by_pixels(0.5 * PERIOD_S)
    assert machine.dance(120, "ink") == 1.0
