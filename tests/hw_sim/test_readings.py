"""What the emulated sensor's readings tell the box: rate, axes, round trip and taps."""

from __future__ import annotations

from itertools import pairwise

import pytest

from appliance.sensor import wire
from hw_sim import motions
from hw_sim.emulated_sensor import sensor_axes
from tests.hw_sim.tiny_box import TinyBox, paired, readings


def test_the_round_trip_is_measured_by_the_echo() -> None:
    pair = paired()
    pair.run(5.0)
    assert readings(pair)[0].round_trip == wire.ROUND_TRIP_UNKNOWN
    assert 0 <= readings(pair)[-1].round_trip < 100  # less than 10 ms on a line without length


def test_the_rate_is_the_one_that_the_box_wants() -> None:
    box = TinyBox()
    box.rate_hz = 100
    pair = paired(box=box)
    pair.run(2.0)
    assert len(readings(pair)) == pytest.approx(130, abs=2)
    times_us = [reading.sensor_time_us for reading in readings(pair)]
    assert {b - a for a, b in pairwise(times_us)} == {10_000}


def test_readings_are_in_the_axes_of_the_sensor() -> None:
    turn = motions.about((0, 1, 0), 0.7)  # stage: about the vertical
    pair = paired(motions.still(turn))
    pair.run(1.0)
    w, x, y, z = readings(pair)[0].orientation
    assert (w, y, z, x) == pytest.approx(turn, abs=1e-4)  # the box's permutation gives it back
    assert sensor_axes(turn)[3] == pytest.approx(turn[2])  # the sensor's vertical is z


def test_double_taps_are_counted() -> None:
    pair = paired()
    pair.run(1.0)
    pair.device.taps += 1
    pair.run(0.1)
    assert (readings(pair)[0].taps, readings(pair)[-1].taps) == (0, 1)
