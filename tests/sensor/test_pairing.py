"""Pairing, the box's side, on invented times: let in at power-on, kept, lost, found again, on any way."""

from __future__ import annotations

from dataclasses import replace

from appliance.sensor import wire
from tests.sensor.peers import EIGHT, KEYS, A, B, Box, Wearable, dance, state


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
