"""While a sensor is linked, on invented times: heartbeats, its light, and what a technician sees of it."""

from __future__ import annotations

import pytest

from appliance.sensor import wire
from tests.sensor.peers import EIGHT, IMU_ID, Box, dance, state


def test_heartbeats_come_each_second_and_echo_the_newest_reading() -> None:
    box = Box()
    sensor = box.pair()
    heard = dance(box, sensor, 10.0)
    assert all(isinstance(packet, wire.Heartbeat) for packet in heard)
    assert 10 <= len(heard) <= 12
    assert [packet.sequence for packet in heard] == list(range(1, len(heard) + 1))
    assert {packet.session for packet in heard} == {sensor.session}
    box.hear(sensor.reading())
    box.now += 1.0025
    ((data, _),) = box.answers()
    echo = sensor.hear(data)
    assert isinstance(echo, wire.Heartbeat)
    assert (echo.echo_sequence, echo.echo_held_us) == (sensor.sequence, 1_002_500)


def test_heartbeats_of_eight_sensors_leave_in_eight_different_ticks() -> None:
    box = Box(EIGHT)
    sensors = [box.pair(name) for name in EIGHT]
    for sensor in sensors:
        box.hear(sensor.reading())
    most = 0
    for n in range(150):
        box.now += 0.02
        for sensor in sensors:
            box.hear(sensor.reading())
        sent = box.answers()
        if n > 50:
            most = max(most, len(sent))
    assert most == 1


def test_a_sensor_that_falls_silent_gets_no_more_heartbeats_and_is_lost() -> None:
    box = Box()
    sensor = box.pair()
    dance(box, sensor, 1.0)
    for _ in range(300):
        box.now += 0.02
        box.answers()
    assert box.link.sent["heartbeat"] <= 6
    assert state(box).state == "lost"
    dance(box, sensor, 1.1)
    assert state(box).state == "linked"
    assert "reboot" not in box.counted()


def test_the_light_says_what_the_box_wants_at_once() -> None:
    box = Box()
    sensor = box.pair()
    dance(box, sensor, 2.05)

    def light() -> list[int]:
        return [packet.led for packet in dance(box, sensor, 0.02) if isinstance(packet, wire.Heartbeat)]

    box.link.wants_neutral.add("left-wrist")
    assert light() == [wire.LED_SLOW]
    box.link.strobe("left-wrist", box.now, seconds=0.03)
    box.link.strobe("nobody", box.now)
    assert light() == [wire.LED_STROBE]
    assert light() == [wire.LED_SLOW]
    box.link.wants_neutral.clear()
    box.link.light = False
    assert light() == [wire.LED_OFF]
    assert light() == []


def test_a_technician_sees_rate_loss_age_and_what_the_sensor_says_of_itself() -> None:
    box = Box()
    sensor = box.pair()
    for n in range(1000):
        box.now += 0.02
        box.answers()
        if n % 4:
            box.hear(sensor.numbered(n))
    box.now += 0.01
    one = state(box)
    assert one.rate_hz == pytest.approx(37.5, abs=1)
    assert one.loss == pytest.approx(0.25, abs=0.01)
    assert one.age_s == pytest.approx(0.01)
    assert one.round_trip_s == pytest.approx(0.0023)
    assert (one.battery, one.calibration, one.firmware, one.imu_id) == (80, 0x3C, "1.2.3", IMU_ID.hex())
    assert (one.device_id, one.boot_nonce, one.complaint) == (0x11, 1, "")
    other = state(box, "head")
    assert (other.state, other.way, other.age_s, other.firmware, other.battery) == (
        "absent",
        "",
        None,
        "",
        255,
    )
