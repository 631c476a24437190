"""Pictures are due on an even grid, whether the display sets the pace or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from appliance.projector.pacing import Pacing

RATE = 60.0
PERIOD_S = 1 / RATE


@dataclass
class Clock:
    """Time passes only by sleeping, drawing and waiting for the display."""

    now: float = 100.0
    overshoot_s: float = 0.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds + self.overshoot_s

    def pacing(self, holds_vsync: bool) -> Pacing:
        return Pacing(RATE, holds_vsync, monotonic=lambda: self.now, sleep=self.sleep)

    def wait_for_display(self) -> None:
        self.now = (np.floor(self.now / PERIOD_S + 1e-6) + 1) * PERIOD_S


def test_without_vsync_the_clock_sets_the_pace() -> None:
    clock = Clock(overshoot_s=0.001)
    pacing = clock.pacing(holds_vsync=False)
    times = []
    for _ in range(120):
        times.append(pacing.wait_for_next())
        clock.now += 0.005  # drawing
    assert np.diff(times) == pytest.approx(PERIOD_S)


def test_missed_pictures_are_not_made_up_for() -> None:
    clock = Clock()
    pacing = clock.pacing(holds_vsync=False)
    pacing.wait_for_next()
    clock.now += 1.0
    late = pacing.wait_for_next()
    assert late == pytest.approx(clock.now)
    assert pacing.wait_for_next() - late == pytest.approx(PERIOD_S)


def test_with_vsync_it_follows_the_display_and_smooths_its_own_jitter() -> None:
    clock, random = Clock(), np.random.default_rng(1)
    pacing = clock.pacing(holds_vsync=True)
    times = []
    for _ in range(600):
        clock.wait_for_display()
        clock.now += random.uniform(0, 0.003)  # this process wakes up late
        times.append(pacing.wait_for_next())
    assert pacing.holds_vsync
    assert np.diff(times[60:]).std() < 0.0002
    assert abs(times[-1] - clock.now) < 0.003


def test_a_display_that_sets_no_pace_is_found_out() -> None:
    clock = Clock()
    pacing = clock.pacing(holds_vsync=True)
    for _ in range(200):
        clock.now += 0.001
        pacing.wait_for_next()
    assert not pacing.holds_vsync
    begun = clock.now
    for _ in range(60):
        pacing.wait_for_next()
    assert clock.now - begun == pytest.approx(1.0, abs=0.02)


def test_a_slow_graphics_card_is_no_broken_vsync() -> None:
    clock = Clock()
    pacing = clock.pacing(holds_vsync=True)
    for _ in range(200):
        clock.now += 0.07
        assert pacing.wait_for_next() == pytest.approx(clock.now)
    assert pacing.holds_vsync
