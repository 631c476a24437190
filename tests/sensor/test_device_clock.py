"""The sensor's clock on the box's: jitter, stalls, drift, wraps, jumps, reboots, on invented times."""

from __future__ import annotations

import random

import pytest

from appliance.sensor.device_clock import WRAP_US, DeviceClock

LEAST_DELAY_S = 0.002


class Sensor:
    """Readings at 50 Hz with a true moment of measurement, a drifting clock and a jittering way."""

    def __init__(self, drift_ppm: float = 0.0, start_us: int = 0, seed: int = 1) -> None:
        self.random = random.Random(seed)
        self.clock = DeviceClock()
        self.rate = 1.0 + drift_ppm * 1e-6
        self.start_us = start_us
        self.true_s = 1000.0

    def device_us(self) -> int:
        return (self.start_us + round((self.true_s - 1000.0) * self.rate * 1e6)) % WRAP_US

    def reading(self, extra_s: float = 0.0) -> float:
        """The error of the mapped moment of measurement, in seconds; late is positive."""
        self.true_s += 0.02
        arrival = self.true_s + LEAST_DELAY_S + self.random.expovariate(1 / 0.001) + extra_s
        if self.random.random() < 0.005:
            arrival += self.random.uniform(0.03, 0.245)
        measured_at = self.clock.observe(self.clock.unwrap(self.device_us(), arrival), arrival)
        assert measured_at <= arrival
        return measured_at - self.true_s

    def errors(self, seconds: float, extra_s: float = 0.0) -> list[float]:
        return [self.reading(extra_s) for _ in range(round(seconds * 50))]


@pytest.mark.parametrize("drift_ppm", [-200.0, -50.0, 0.0, 50.0, 200.0])
def test_jitter_and_drift_are_taken_out(drift_ppm: float) -> None:
    sensor = Sensor(drift_ppm)
    sensor.errors(30)
    errors = sensor.errors(300)
    assert max(errors) < LEAST_DELAY_S + 0.0006
    assert min(errors) > LEAST_DELAY_S - 0.0006
    assert sensor.clock.drift_ppm == pytest.approx(-drift_ppm, abs=25)


def test_useful_from_the_first_second() -> None:
    sensor = Sensor(100.0)
    sensor.errors(1)
    assert max(abs(error - LEAST_DELAY_S) for error in sensor.errors(10)) < 0.0015


def test_the_wrap_after_71_minutes_is_not_seen() -> None:
    sensor = Sensor(50.0, start_us=WRAP_US - 40_000_000)
    errors = sensor.errors(90)[2000 - 50 * 5 :]
    assert max(abs(error - LEAST_DELAY_S) for error in errors) < 0.001
    assert sensor.clock.unwrap(sensor.device_us(), sensor.true_s) > WRAP_US


def test_wraps_in_a_long_silence_are_counted_by_the_arrival() -> None:
    sensor = Sensor()
    sensor.errors(10)
    sensor.true_s += 3 * WRAP_US * 1e-6 + 123.0
    errors = sensor.errors(5)
    assert max(abs(error - LEAST_DELAY_S) for error in errors) < 0.005


def test_a_reboot_starts_anew() -> None:
    sensor = Sensor()
    sensor.errors(60)
    sensor.true_s += 2.0
    sensor.start_us = -round((sensor.true_s - 1000.0) * 1e6)
    sensor.clock.reset()
    sensor.errors(1)
    assert max(abs(error - LEAST_DELAY_S) for error in sensor.errors(30)) < 0.0015


@pytest.mark.parametrize("jump_us", [-30_000_000, -2_000_000, 2_000_000, 30_000_000])
def test_a_clock_that_jumps_is_followed_within_seconds(jump_us: int) -> None:
    sensor = Sensor(start_us=100_000_000)
    sensor.errors(60)
    sensor.start_us += jump_us
    sensor.errors(3)
    assert max(abs(error - LEAST_DELAY_S) for error in sensor.errors(60)) < 0.0015


def test_a_network_that_fills_up_for_half_a_minute_does_not_bend_the_clock() -> None:
    sensor = Sensor()
    sensor.errors(60)
    errors = sensor.errors(25, extra_s=0.15)
    assert max(abs(error - LEAST_DELAY_S) for error in errors) < 0.001


def test_the_memory_is_bounded() -> None:
    sensor = Sensor()
    sensor.errors(600)
    assert len(sensor.clock._points) <= 62
