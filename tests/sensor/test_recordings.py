"""Recordings of hundreds of power-ons, or the key itself: no sensor loses its turn, and the box says so."""

from __future__ import annotations

import pytest

from tests.sensor.peers import KEYS, STRANGER, A, B, Box, Wearable, linked_box


def test_hundreds_of_recorded_power_ons_at_ten_thousand_a_second_do_not_either() -> None:
    """More than the box had room for: each took the turn of a sensor that was switched on meanwhile."""
    recorded = [Wearable(KEYS["left-wrist"], boot).hello() for boot in range(1000, 1600)]
    box = Box()
    sensor = Wearable(KEYS["left-wrist"], boot=9)
    for n in range(200):
        box.now += 0.02
        at = 200 * n % len(recorded)
        box.hear(*recorded[at : at + 100], origin=STRANGER)
        if n == 100:
            box.hear(sensor.hello())
        box.hear(*recorded[at + 100 : at + 200], origin=STRANGER)
        if any(sensor.hear(data) for data, to in box.answers() if to == A):
            break
    assert n == 100  # answered in its own tick
    assert len(box.hear(sensor.reading())) == 1


def test_hundreds_of_recorded_power_ons_that_greet_anew_each_time_do_not_either() -> None:
    """Hellos that this box never heard: none of them is old, and all of them wait for an answer."""
    before = [Wearable(KEYS["left-wrist"], boot) for boot in range(1000, 1600)]
    box = Box()
    sensor = Wearable(KEYS["left-wrist"], boot=9)
    ticks = 0
    for n in range(200):
        box.now += 0.02
        at = 100 * n % len(before)
        box.hear(*(one.hello() for one in before[at : at + 100]), origin=STRANGER)
        if n >= 100:
            ticks += 1
            if n % 25 == 0:
                box.hear(sensor.hello())
        if any(sensor.hear(data) for data, to in box.answers() if to == A):
            break
    assert ticks == 1
    assert len(box.hear(sensor.reading())) == 1


def test_hundreds_of_recorded_readings_do_not_take_the_call_of_a_sensor_whose_box_was_started_anew() -> None:
    recorded = [Box().pair(boot=boot).reading() for boot in range(1000, 1600)]
    sensor = Box().pair(boot=6)
    box = Box(now=200.0)
    for n in range(200):
        box.now += 0.02
        at = 200 * n % len(recorded)
        box.hear(*recorded[at : at + 200], origin=STRANGER)
        if n >= 100:
            box.hear(sensor.reading())
        if any(data[8:12] == (6).to_bytes(4, "little") for data, _ in box.answers()):
            break
    assert n == 100


@pytest.mark.parametrize("ahead", [1_000, 1 << 31, (1 << 32) - 1])
def test_a_signed_jump_of_the_sequence_silences_nobody(ahead: int) -> None:
    box, sensor = linked_box()
    box.now += 0.02
    assert box.hear(sensor.numbered(ahead)) == ()
    assert box.counted()["ahead"] == 1
    for _ in range(10):
        box.now += 0.02
        assert len(box.hear(sensor.reading())) == 1


def test_readings_lost_for_minutes_are_no_jump() -> None:
    box, sensor = linked_box()
    box.now += 120.0
    sensor.sequence += 6000
    assert len(box.hear(sensor.reading())) == 1


def test_a_clock_that_steps_back_takes_no_reading_away_from_its_time() -> None:
    box, sensor = linked_box()
    at_us = 20_000 * sensor.sequence
    box.now += 0.02
    at_us += 20_000
    assert len(box.hear(sensor.reading(0.0, at_us))) == 1
    box.now += 0.02
    (stepped,) = box.hear(sensor.reading(1.0, at_us - 1_000))
    assert abs(stepped.measured_at - box.now) < 0.1
    box.now += 0.02
    (reading,) = box.hear(sensor.reading(1.0, at_us + 20_000))
    assert reading.sensor_time_us == at_us + 20_000 and abs(reading.measured_at - box.now) < 0.1


def test_two_wearables_with_one_key_are_named() -> None:
    """Each takes the place of the other, which finds its box gone after 3 s and says hello."""
    box = Box()
    one, other = box.pair(boot=1), Wearable(KEYS["left-wrist"], boot=2)
    box.hear(one.reading())
    assert box.link.states(box.now)[0].complaint == ""
    box.greet(other, origin=B)
    box.hear(other.reading(), origin=B)
    assert box.link.states(box.now)[0].complaint == ""  # switched off and on looks the same
    box.now += 3.0
    box.greet(one)
    assert len(box.hear(one.reading())) == 1
    complaint = box.link.states(box.now)[0].complaint
    assert complaint.startswith("Two wearables are on with the key of left-wrist")
    assert box.link.states(box.now)[1].complaint == ""
    box.now += 60.0
    box.greet(one)
    box.hear(one.reading())
    assert box.link.states(box.now)[0].complaint == ""
