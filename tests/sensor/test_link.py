"""The link's judgement, packet by packet, on invented times: new, stale, believed or not."""

from __future__ import annotations

import random
from itertools import pairwise
from math import cos, radians

import pytest

from appliance.sensor import wire
from tests.sensor.peers import EIGHT, IMU_ID, KEYS, Box, dance, state


def test_a_reading_arrives_with_all_that_it_carries() -> None:
    box = Box()
    sensor = box.pair(boot=77, flags=wire.IS_NDOF)
    (reading,) = box.hear(sensor.numbered(7, degrees=30))
    assert reading.sensor == "left-wrist"
    assert reading.orientation == pytest.approx((cos(radians(15)), cos(radians(75)), 0, 0), abs=1e-4)
    assert (reading.sequence, reading.sensor_time_us) == (7, 140_000)
    assert (reading.battery, reading.calibration, reading.boot_nonce) == (80, 0x3C, 77)
    assert (reading.taps, reading.recoveries, reading.flags) == (1, 2, wire.IS_NDOF)
    assert reading.round_trip_s == pytest.approx(0.0023)
    assert reading.arrival == reading.measured_at == box.now
    assert box.link.newest_arrival("left-wrist") == box.now
    assert box.link.newest_arrival("head") is None
    assert box.link.newest_arrival("nobody") is None
    assert box.hear() == ()


def test_a_round_trip_that_the_sensor_does_not_know_yet() -> None:
    box = Box()
    sensor = box.pair()
    (reading,) = box.hear(sensor.reading(round_trip=wire.ROUND_TRIP_UNKNOWN))
    assert reading.round_trip_s is None


def test_the_newest_of_a_burst_wins_for_each_sensor() -> None:
    box = Box()
    sensors = [box.pair(name) for name in KEYS]
    burst = [sensor.numbered(n) for n in range(12) for sensor in sensors]
    assert {reading.sensor: reading.sequence for reading in box.hear(*burst)} == {
        "left-wrist": 11,
        "head": 11,
    }
    assert box.counted() == {"hello": 2, "accepted": 24}


def test_every_believed_arrival_of_a_drain_is_kept_for_the_phase() -> None:
    box = Box()
    sensor = box.pair()
    sent = [(99.95, 1.0), (99.97, 1.0), (99.99, 0.0)]
    for n, (arrival, length) in enumerate(sent):
        box.wires.waiting.append((sensor.numbered(n, length=length), arrival, ("192.168.4.7", 2390)))
    box.now = 100.0
    box.hear(sensor.numbered(3))
    assert list(box.link.arrivals("left-wrist")) == [99.95, 99.97, 100.0]
    assert list(box.link.arrivals("nobody")) == []
    box.hear()
    assert list(box.link.arrivals("left-wrist")) == []


def test_overtaken_repeated_and_long_gone_readings_are_told_apart() -> None:
    box = Box()
    sensor = box.pair()
    box.hear(sensor.numbered(100), sensor.numbered(103))
    stale = [sensor.numbered(n) for n in (103, 100, 101, 103 - 64)]
    assert box.hear(*stale) == ()
    assert box.counted() == {"hello": 1, "accepted": 2, "lost": 2, "duplicate": 2, "reordered": 1, "old": 1}


def test_within_one_drain_an_overtaken_reading_does_not_win() -> None:
    box = Box()
    sensor = box.pair()
    (reading,) = box.hear(*[sensor.numbered(n) for n in (1, 3, 2)])
    assert reading.sequence == 3


def test_the_sign_is_continuous_whatever_the_sensor_sends() -> None:
    box = Box()
    sensor = box.pair()
    before = (1.0, 0.0, 0.0, 0.0)
    for n in range(40):
        box.now += 0.02
        (reading,) = box.hear(sensor.numbered(n, degrees=20 * n + 5 + 360 * (n % 2)))
        assert sum(a * b for a, b in zip(before, reading.orientation, strict=True)) > 0.9
        before = reading.orientation


@pytest.mark.parametrize("length", [0.0, 0.001, 0.97, 1.02])
def test_a_reading_without_an_orientation_is_refused_and_makes_no_sensor_young(length: float) -> None:
    box = Box()
    sensor = box.pair()
    box.hear(sensor.numbered(1))
    heard = box.now
    box.now += 0.02
    assert box.hear(sensor.numbered(2, length=length)) == ()
    assert box.link.newest_arrival("left-wrist") == heard
    (reading,) = box.hear(sensor.numbered(3, degrees=170, length=1.005))
    assert sum(part * part for part in reading.orientation) == pytest.approx(1.0, abs=1e-12)
    assert box.counted() == {"hello": 1, "accepted": 2, "norm": 1}


def test_device_time_wraps_under_way() -> None:
    box = Box()
    sensor = box.pair()
    times_us = []
    for n in range(100):
        box.now += 0.02
        moment_us = (2**32 - 1_000_000 + 20_000 * n) % 2**32
        (reading,) = box.hear(sensor.numbered(n, degrees=30 * n, time_us=moment_us))
        times_us.append(reading.sensor_time_us)
    assert {b - a for a, b in pairwise(times_us)} == {20_000}


def test_a_new_power_on_starts_the_clock_from_zero() -> None:
    box = Box()
    for boot, time_us in ((1, 30_000), (2, 50_000), (3, 20_000)):
        (reading,) = box.hear(box.pair(boot=boot).numbered(7, degrees=170 * (boot % 2), time_us=time_us))
        assert (reading.sequence, reading.sensor_time_us, reading.boot_nonce) == (7, time_us, boot)
    assert box.counted() == {"hello": 3, "accepted": 3, "reboot": 2}


def test_what_is_sent_to_nobody_is_not_lost() -> None:
    box = Box()
    sensor = box.pair()
    box.hear(sensor.numbered(1))
    box.now += 3.5  # the sensor has left the link meanwhile
    box.hear(sensor.numbered(170))
    box.now += 0.1
    box.hear(sensor.numbered(175))
    assert box.counted()["lost"] == 4


def test_packets_that_only_a_box_sends_are_counted() -> None:
    box = Box()
    key = KEYS["head"]
    heartbeat = wire.Heartbeat(key.device_id, 1, 0, 1, 0, 0, 1)
    assert box.hear(wire.pack(heartbeat, wire.Tagger(key.key))) == ()
    assert box.counted() == {"kind": 1}


def test_readings_cannot_be_changed_by_whoever_gets_them() -> None:
    box = Box()
    (reading,) = box.hear(box.pair().reading())
    with pytest.raises(AttributeError):
        reading.sequence = 2  # type: ignore[misc]


def test_a_genuine_packet_with_any_payload_never_raises() -> None:
    rng = random.Random(7)
    box = Box()
    sensor = box.pair("head")
    head = sensor.numbered(0)[:16]
    payload = wire.READING.signed_bytes - 20
    for n in range(5000):
        signed = head + n.to_bytes(4, "little") + rng.randbytes(payload)
        box.now += rng.choice([0.0, 0.02, 0.7, 6000.0])
        box.hear(signed + sensor.tagger.tag(signed))
        box.answers()
        box.link.states(box.now)
    counted = box.counted()
    assert counted.get("accepted", 0) < 5000
    assert "tag" not in counted


def test_what_a_wearable_tells_about_its_radio_stands_in_its_flags() -> None:
    box = Box()
    sensor = box.pair()
    for flags, dbm in ((0, None), (0x10, -86), (0x70 | wire.IS_NDOF, -62), (0xF0, -30)):
        box.hear(sensor.reading(flags=flags))
        (state,) = [one for one in box.link.states(box.now) if one.name == "left-wrist"]
        assert wire.signal_dbm(state.flags) == dbm and not state.complaint
    box.hear(sensor.reading(flags=0x70 | wire.RADIO_IS_OLD))
    (state,) = [one for one in box.link.states(box.now) if one.name == "left-wrist"]
    assert "left-wrist has firmware older than 19.5.4" in state.complaint


def test_who_sends_what_is_none_of_ours_is_told_by_name() -> None:
    box = Box()
    sensor = box.pair()
    assert (box.link.stranger, box.link.refused()) == ("", {})
    box.wires.waiting.append((b"hello, world", 100.0, ("192.168.4.99", 5353)))
    box.hear(sensor.numbered(1, length=0.5))
    assert box.link.stranger == "192.168.4.99:5353"
    assert box.link.refused() == {"left-wrist": 1}
    assert box.link.lets_in("left-wrist") and not box.link.lets_in("nobody")


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
