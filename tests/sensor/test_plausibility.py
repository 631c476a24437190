"""The gate: what a hand cannot do is kept out, what it has done is let in again."""

from __future__ import annotations

from math import cos, radians, sin

import pytest

from appliance.sensor.plausibility import CONSISTENT_READINGS, TIMEOUT_S, Orientation, PlausibilityGate

STEP_US = 20_000


def about_x(degrees: float) -> Orientation:
    half = radians(degrees) / 2
    return (cos(half), sin(half), 0.0, 0.0)


class Feed:
    """Feeds a gate at 50 Hz."""

    def __init__(self) -> None:
        self.gate = PlausibilityGate()
        self.time_us = 0

    def __call__(self, orientation: Orientation, after_us: int = STEP_US) -> str:
        self.time_us += after_us
        unit, fate = self.gate.admit(orientation, self.time_us, self.time_us * 1e-6)
        assert (unit is None) == (fate not in ("accepted", "relocated"))
        if unit is not None:
            assert sum(part * part for part in unit) == pytest.approx(1.0, abs=1e-12)
        return fate


def test_a_dancing_hand_passes() -> None:
    feed = Feed()
    for step in range(500):
        assert feed(about_x(39.0 * step)) == "accepted"


@pytest.mark.parametrize(
    ("orientation", "fate"),
    [
        ((0.0, 0.0, 0.0, 0.0), "zero"),
        ((0.001, 0.0, 0.0, 0.0), "zero"),
        ((1.02, 0.0, 0.0, 0.0), "norm"),
        ((0.97, 0.0, 0.0, 0.0), "norm"),
        ((1.0, 1.0, 1.0, 1.0), "norm"),
        ((float("nan"), 0.0, 0.0, 0.0), "norm"),
        ((float("inf"), 0.0, 0.0, 0.0), "norm"),
    ],
)
def test_what_is_no_orientation(orientation: Orientation, fate: str) -> None:
    feed = Feed()
    assert feed(orientation) == fate
    assert feed(about_x(0)) == "accepted"
    assert feed(orientation) == fate
    assert feed(about_x(1)) == "accepted"


def test_the_opposite_sign_is_the_same_orientation() -> None:
    feed = Feed()
    for step in range(50):
        w, x, y, z = about_x(20.0 * step + 5.0)
        assert feed((w, x, y, z) if step % 2 else (-w, -x, -y, -z)) == "accepted"


def test_one_impossible_jump_is_refused_and_forgotten() -> None:
    feed = Feed()
    feed(about_x(0))
    assert feed(about_x(90)) == "rate"
    assert feed(about_x(2)) == "accepted"
    assert feed(about_x(90)) == "rate"


def test_alternating_garbage_never_gets_in_while_good_readings_come() -> None:
    feed = Feed()
    feed(about_x(0))
    for _ in range(200):
        assert feed(about_x(150)) == "rate"
        assert feed(about_x(0)) == "accepted"


def test_a_sensor_that_has_truly_moved_is_believed_after_a_few_agreeing_readings() -> None:
    feed = Feed()
    feed(about_x(0))
    fates = [feed(about_x(170 + step)) for step in range(CONSISTENT_READINGS + 1)]
    assert fates == ["rate"] * (CONSISTENT_READINGS - 1) + ["relocated", "accepted"]


def test_readings_that_never_agree_are_believed_after_the_timeout_so_nobody_is_locked_out() -> None:
    feed = Feed()
    feed(about_x(0))
    fates = [feed(about_x(180 if step % 2 else -120)) for step in range(30)]
    believed = fates.index("relocated")
    assert believed * STEP_US * 1e-6 == pytest.approx(TIMEOUT_S, abs=0.03)


def test_a_device_clock_that_stands_still_locks_nobody_out() -> None:
    gate = PlausibilityGate()
    gate.admit(about_x(0), 1000, 0.0)
    fates = [gate.admit(about_x(180 if step % 2 else -120), 1000, 0.02 * step)[1] for step in range(1, 30)]
    assert "relocated" in fates


def test_after_a_gap_the_hand_may_be_anywhere() -> None:
    feed = Feed()
    feed(about_x(0))
    assert feed(about_x(170), after_us=245_000) == "accepted"


@pytest.mark.parametrize("component", range(4))
@pytest.mark.parametrize("degrees_off", [4.0, 6.0, 8.0])
def test_a_flipped_top_bit_with_unit_norm_is_refused(component: int, degrees_off: float) -> None:
    half = radians(degrees_off) / 2
    still = [0.0] * 4
    still[component], still[(component + 1) % 4] = cos(half), sin(half)
    flipped = list(still)
    flipped[component] -= 2.0
    feed = Feed()
    feed(tuple(still))  # type: ignore[arg-type]
    assert feed(tuple(flipped)) == "torn"  # type: ignore[arg-type]
    assert feed(tuple(still)) == "accepted"  # type: ignore[arg-type]


@pytest.mark.parametrize("speed", [-600.0, -300.0, 300.0, 600.0])
def test_a_flipped_top_bit_is_refused_while_the_arm_moves_too(speed: float) -> None:
    feed = Feed()
    for step in range(-10, 0):
        assert feed(about_x(8.0 + speed * 0.02 * step)) == "accepted"
    half = radians(8.0) / 2
    assert feed((cos(half) - 2.0, sin(half), 0.0, 0.0)) == "torn"
    assert feed(about_x(8.0 + speed * 0.02)) == "accepted"


def test_plus_one_read_as_minus_one_is_the_same_orientation_and_moves_nothing() -> None:
    gate = PlausibilityGate()
    gate.admit((1.0, 0.0, 0.0, 0.0), 0, 0.0)
    unit, _ = gate.admit((-1.0, 0.0, 0.0, 0.0), STEP_US, 0.02)
    assert unit is not None
    assert abs(unit[0]) == 1.0


def test_swinging_through_the_identity_is_no_flipped_bit() -> None:
    feed = Feed()
    for step in range(200):
        assert feed(about_x(15 if step % 2 else -15)) == "accepted"


def test_a_bad_first_reading_is_overruled() -> None:
    feed = Feed()
    feed(about_x(120))
    fates = [feed(about_x(0)) for _ in range(CONSISTENT_READINGS)]
    assert fates[-1] == "relocated"
