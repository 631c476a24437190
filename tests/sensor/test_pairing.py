"""Pairing, the box's side, on invented times: let in at power-on, kept, lost, found again, on any way."""

from __future__ import annotations

from dataclasses import replace

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorState
from appliance.sensor.memory import MOST_PROFILES
from tests.sensor.peers import IMU_ID, KEYS, A, B, Box, Wearable

EIGHT = {f"hand-{n}": SensorKey(f"hand-{n}", 0x100 + n, bytes([n]) * 16) for n in range(8)}
OFFSETS = bytes(range(22))


def state(box: Box, name: str = "left-wrist") -> SensorState:
    return next(one for one in box.link.states(box.now) if one.name == name)


def dance(box: Box, sensor: Wearable, seconds: float, origin: tuple[str, int] = A) -> list[wire.Packet]:
    """Readings at 50 Hz; what the box sent meanwhile."""
    heard = []
    for _ in range(round(50 * seconds)):
        box.now += 0.02
        assert len(box.hear(sensor.reading(), origin=origin)) == 1
        for data, to in box.answers():
            if data[4] == sensor.key.device_id:
                assert to == origin
                heard.append(sensor.hear(data))
    return heard


def test_a_hello_is_answered_and_the_first_reading_counts() -> None:
    box = Box(hands=("head", "left-wrist"))
    sensor = Wearable(KEYS["left-wrist"])
    assert state(box).state == "absent"
    box.hear(sensor.hello())
    assert state(box).state == "greeted"
    ((data, to),) = box.answers()
    assignment = sensor.hear(data)
    assert isinstance(assignment, wire.Assignment)
    assert to == A
    assert (assignment.hand, assignment.rate_hz, assignment.led) == (1, 50, wire.LED_ON)
    assert assignment.session != 0
    assert state(box).state == "greeted"
    (reading,) = box.hear(sensor.reading())
    assert reading.sensor == "left-wrist"
    assert state(box).state == "linked"


def test_the_same_power_on_gets_the_same_session_and_another_one_another() -> None:
    box = Box()
    sensor = box.pair()
    first = sensor.session
    box.greet(sensor)
    assert sensor.session == first
    box.hear(sensor.reading())
    box.greet(sensor)
    assert sensor.session == first
    assert box.pair(boot=2).session != first
    assert box.pair("head", boot=1).session != first
    assert Box().pair().session != first


def test_a_repeated_hello_is_answered_at_most_each_tenth_of_a_second_and_each_only_once() -> None:
    box = Box()
    sensor = Wearable(KEYS["head"])
    answered = 0
    for _ in range(100):
        box.now += 0.01
        hello = sensor.hello()
        box.hear(hello, hello)
        answered += len(box.answers())
    assert 9 <= answered <= 11
    assert box.counted() == {"hello": 100, "old_hello": 100}


def test_the_newest_hello_is_the_one_that_is_answered() -> None:
    box = Box()
    sensor = Wearable(KEYS["head"])
    box.hear(sensor.hello(), origin=B)
    box.hear(sensor.hello(), origin=A)
    ((data, to),) = box.answers()
    sensor.hear(data)
    assert to == A


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


def test_a_reading_of_an_unknown_session_is_called_and_pairs_after_a_restart_of_the_box() -> None:
    sensor = Box().pair()
    box = Box(now=200.0)
    assert box.hear(sensor.reading(), sensor.reading()) == ()
    ((data, to),) = box.answers()
    assert to == A
    assert isinstance(sensor.hear(data), wire.Call)
    box.greet(sensor)
    assert len(box.hear(sensor.reading())) == 1
    assert box.counted() == {"old_session": 2, "hello": 1, "accepted": 1}


def test_calls_are_few() -> None:
    sensor = Box().pair()
    box = Box()
    for _ in range(100):
        box.now += 0.01
        box.hear(sensor.reading())
        box.answers()
    assert 4 <= box.link.sent["call"] <= 6


def test_a_reboot_is_followed_as_soon_as_the_new_session_speaks() -> None:
    box = Box()
    before = box.pair(boot=1)
    dance(box, before, 1.0)
    after = box.pair(boot=2)
    dance(box, before, 0.02)  # still in force until the new one speaks
    dance(box, after, 1.0)
    assert state(box).boot_nonce == 2
    assert box.hear(before.reading()) == ()
    assert box.counted()["reboot"] == 1


def test_roaming_from_address_to_address_to_cable_and_back() -> None:
    box = Box()
    sensor = box.pair(origin=A)
    dance(box, sensor, 1.0, A)
    assert box.wires.attended == {A}
    dance(box, sensor, 1.1, B)  # its address has changed under way: no hello needed
    assert box.wires.attended == {B}
    assert state(box).way == "192.168.4.8:2390"

    plug = ("/dev/ttyACM0", 0)
    session = sensor.session
    box.hear(sensor.hello(), origin=plug, wires=box.cable)
    dance(box, sensor, 0.02, B)  # the link stays where readings come from
    assignment = [sensor.hear(data) for data, _ in box.answers(box.cable)]
    assert [type(packet) for packet in assignment] == [wire.Assignment]
    assert sensor.session == session
    box.now += 0.02
    assert len(box.hear(sensor.reading(), origin=plug, wires=box.cable)) == 1
    box.answers()
    assert state(box).way == "/dev/ttyACM0:0"
    assert (box.wires.attended, box.cable.attended) == (set(), {plug})

    box.greet(sensor, A)
    dance(box, sensor, 1.0, A)
    assert sensor.session == session
    assert box.counted() == {"hello": 3, "accepted": sensor.sequence}


def test_an_overtaken_reading_of_the_way_before_does_not_move_the_link_back() -> None:
    box = Box()
    sensor = box.pair()
    box.hear(sensor.numbered(1), origin=A)
    box.hear(sensor.numbered(3), origin=B)
    box.hear(sensor.numbered(2), origin=A)
    assert state(box).way == "192.168.4.8:2390"


def test_another_wire_is_not_assigned_but_said() -> None:
    box = Box()
    sensor = Wearable(KEYS["head"])
    box.hear(sensor.hello(wire_hash=0x1234))
    assert box.answers() == []
    assert box.counted() == {"other_wire": 1}
    complaint = state(box, "head").complaint
    assert "Sensor head speaks another wire" in complaint
    assert "1.2.3: 00001234" in complaint
    assert f"{wire.WIRE_HASH:08x}" in complaint
    box.hear(sensor.hello())
    assert state(box, "head").complaint == ""


def test_a_calibration_is_restored_to_a_sensor_that_has_none() -> None:
    box = Box(profiles={IMU_ID: OFFSETS})
    sensor = box.pair()
    heard = dance(box, sensor, 10.0)
    restores = [packet for packet in heard if isinstance(packet, wire.Restore)]
    assert len(restores) == 5
    assert isinstance(heard[0], wire.Heartbeat) and heard[1] is restores[0]
    assert {(packet.imu_id, packet.offsets) for packet in restores} == {(IMU_ID, OFFSETS)}


def test_a_calibration_is_restored_until_it_is_in_use() -> None:
    box = Box(profiles={IMU_ID: OFFSETS})
    sensor = box.pair()
    dance(box, sensor, 0.02)
    sensor.flags = wire.HAS_PROFILE
    assert [type(packet) for packet in dance(box, sensor, 3.0)] == [wire.Heartbeat] * 3
    assert box.link.sent["restore"] == 1
    assert state(box).flags == wire.HAS_PROFILE


def test_another_imus_calibration_is_not_restored() -> None:
    box = Box(profiles={bytes(16): OFFSETS})
    dance(box, box.pair(), 2.0)
    assert box.link.sent["restore"] == 0


def test_a_saved_calibration_is_kept_once_and_goes_to_the_next_power_on() -> None:
    box = Box()
    sensor = box.pair()
    assert box.hear(sensor.profile(OFFSETS)) == ()  # nobody knows yet that it is there: not linked
    dance(box, sensor, 0.02)
    sent = [sensor.profile(OFFSETS) for _ in range(3)]
    box.hear(*sent)
    box.hear(*sent)
    assert box.link.take_profiles() == [(IMU_ID, OFFSETS)]
    assert box.link.take_profiles() == []
    assert box.counted() == {"hello": 1, "old_session": 1, "accepted": 1, "profile": 3, "duplicate": 3}
    dance(box, box.pair(boot=2), 0.02)
    assert box.link.sent["restore"] == 1


def test_a_sensor_that_sends_calibrations_without_end_fills_nothing() -> None:
    box = Box()
    sensor = box.pair()
    box.hear(sensor.reading())
    for number in range(1000):
        assert box.hear(sensor.profile(imu_id=number.to_bytes(16, "big"))) == ()
    taken = box.link.take_profiles()
    assert [imu_id[-2:] for imu_id, _ in taken] == [
        number.to_bytes(2, "big") for number in range(1000 - MOST_PROFILES, 1000)
    ]
    assert box.link.take_profiles() == []


def test_a_key_file_read_anew_keeps_who_dances_and_sends_away_who_is_gone() -> None:
    box = Box(hands=("left-wrist", "head"))
    wrist, head = box.pair("left-wrist"), box.pair("head")
    dance(box, wrist, 1.0)
    box.hear(head.reading(), origin=B)
    wrist_key, head_key = KEYS["left-wrist"], KEYS["head"]
    box.link.set_keys(
        {"right-wrist": replace(wrist_key, name="right-wrist"), "head": replace(head_key, key=bytes(16))}
    )
    (reading,) = box.hear(wrist.reading())
    assert reading.sensor == "right-wrist"
    assert box.hear(head.reading(), origin=B) == ()
    assert box.counted()["old_session"] == 1
    assert [one.state for one in box.link.states(box.now)] == ["linked", "absent"]
    box.link.set_keys(KEYS)  # back again: what was recorded before is worth nothing
    assert box.hear(head.numbered(1), origin=B) == ()
    assert box.counted()["old_session"] == 2
    box.link.set_keys({})
    assert box.hear(wrist.reading(), head.reading()) == ()
    assert box.answers() == []
    assert box.counted()["device"] == 2
    assert box.link.states(box.now) == []


def test_eight_sensors_at_once_each_with_its_own_session_and_hand() -> None:
    box = Box(EIGHT, hands=tuple(EIGHT))
    sensors = [Wearable(key) for key in EIGHT.values()]
    origins = [(f"192.168.4.{10 + n}", 2390) for n in range(8)]
    for sensor, origin in zip(sensors, origins, strict=True):
        box.hear(sensor.hello(), origin=origin)
    for data, to in box.answers():
        sensors[origins.index(to)].hear(data)
    assert len({sensor.session for sensor in sensors}) == 8
    assert [sensor.heard[0].hand for sensor in sensors] == list(range(8))  # type: ignore[attr-defined]
    for _ in range(100):
        box.now += 0.02
        for sensor, origin in zip(sensors, origins, strict=True):
            box.wires.waiting.append((sensor.reading(), box.now, origin))
        assert {reading.sensor for reading in box.hear()} == set(EIGHT)
        box.answers()
    assert box.counted() == {"hello": 8, "accepted": 800}
    assert {one.state for one in box.link.states(box.now)} == {"linked"}
    assert box.wires.attended == set(origins)


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


def test_a_sensor_that_was_lost_and_greets_again_is_greeted() -> None:
    box = Box()
    sensor = box.pair()
    dance(box, sensor, 1.0)
    box.now += 5.0
    assert state(box).state == "lost"
    box.hear(sensor.hello())
    assert state(box).state == "greeted"
    box.now += 5.0
    assert state(box).state == "lost"
