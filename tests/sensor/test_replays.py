"""Replaying what was on the air moves nobody, keeps nobody out and gains no bytes. On invented times."""

from __future__ import annotations

import pytest

from appliance.sensor import wire
from tests.sensor.peers import KEYS, STRANGER, A, Box, Wearable, believed, linked_box, way


def test_replayed_readings_of_the_session_in_force() -> None:
    box = Box()
    sensor = box.pair()
    recorded = []
    for _ in range(200):
        box.now += 0.02
        recorded.append(sensor.reading())
        box.hear(recorded[-1])
    box.answers()
    for _ in range(3):
        box.now += 0.6  # also while the sensor is silent
        assert box.hear(*recorded, origin=STRANGER) == ()
        box.answers()
    assert way(box) == "192.168.4.7:2390"
    assert box.counted() == {"hello": 1, "accepted": 200, "duplicate": 3 * 64, "old": 3 * 136}


class Night:
    """Everything that was on the air in a night with three power-ons, as someone recorded it."""

    def __init__(self) -> None:
        self.box = Box()
        self.recorded: list[bytes] = []
        for boot in (1, 2, 3):
            sensor = Wearable(KEYS["left-wrist"], boot)
            self.recorded.append(sensor.hello())
            self.box.hear(self.recorded[-1])
            self.box.now += 0.2
            for data, _ in self.box.answers():
                sensor.hear(data)
                self.recorded.append(data)
            for _ in range(100):
                self.box.now += 0.02
                self.recorded.append(sensor.reading())
                if boot < 3 or sensor.sequence <= 50:  # the box has not heard all that was on the air
                    self.box.hear(self.recorded[-1])
                self.recorded += [data for data, _ in self.box.answers()]
            self.recorded.append(sensor.profile())
        self.sensor = sensor


def replay(box: Box, recorded: list[bytes]) -> int:
    """Plays a recording in its own rhythm; how many of its readings were believed."""
    came = 0
    for data in recorded:
        box.now += 0.02
        came += len(box.hear(data, origin=STRANGER))
        box.answers()
    return came


def test_a_night_replayed_to_a_box_that_was_started_anew_moves_nothing() -> None:
    night = Night()
    box = Box(now=1000.0)
    assert replay(box, night.recorded) == 0
    assert replay(box, night.recorded) == 0
    assert believed(box) == {"hello": 3}
    assert next(one.state for one in box.link.states(box.now)) != "linked"
    sensor = box.pair(boot=4)
    assert len(box.hear(sensor.reading())) == 1


def test_a_night_replayed_while_a_sensor_dances_changes_nothing_for_it() -> None:
    night = Night()
    box, sensor = linked_box()
    for data in night.recorded * 2:
        box.now += 0.02
        box.hear(data, origin=STRANGER)
        assert [reading.sequence for reading in box.hear(sensor.reading())] == [sensor.sequence]
        for answer, to in box.answers():
            if to == A:
                assert isinstance(sensor.hear(answer), wire.Heartbeat)
    assert way(box) == "192.168.4.7:2390"


def test_readings_of_the_session_before_the_box_was_started_anew() -> None:
    """The same power-on of the sensor, but another session: silent or not, they count no more."""
    sensor = Box().pair()
    held_back = [sensor.numbered(n) for n in range(1000, 1050)]
    box = Box()
    box.greet(sensor)
    for silence_s in (0.0, 0.6):
        assert len(box.hear(sensor.reading())) == 1
        box.now += silence_s
        assert box.hear(*held_back, origin=STRANGER) == ()
        assert way(box) == "192.168.4.7:2390"
    assert box.counted()["old_session"] == 100


def test_an_old_session_is_not_answered_while_its_sensor_is_heard() -> None:
    recorded = [data for data in Night().recorded if data[3] == wire.READING.kind]
    box, sensor = linked_box()
    for _ in range(50):
        box.now += 0.02
        box.hear(*recorded, origin=STRANGER)
        assert all(to == A for _, to in box.answers())
        box.hear(sensor.reading())
    assert box.link.sent["call"] == 0


def test_an_earlier_power_on_of_the_same_night_never_comes_back() -> None:
    """Not even with readings that the box never got: its session ended when the next one's began."""
    box = Box()
    first = box.pair(boot=1)
    box.hear(first.reading())
    held_back = [first.hello()] + [first.reading() for _ in range(50)]
    second = box.pair(boot=2)
    box.hear(second.reading())
    for silence_s in (0.0, 0.6, 5.0):
        box.now += silence_s
        assert replay(box, held_back) == 0
        assert len(box.hear(second.reading())) == 1
    assert box.counted()["reboot"] == 1


def test_a_session_that_was_given_but_never_used_ends_when_another_begins() -> None:
    box = Box()
    first = box.pair(boot=1)
    held_back = [first.hello()] + [first.reading() for _ in range(50)]
    second = box.pair(boot=2)
    box.hear(second.reading())
    box.now += 10.0
    assert replay(box, held_back) == 0
    assert len(box.hear(second.reading())) == 1


def test_replayed_hellos_neither_move_nor_unseat_a_linked_sensor_nor_its_light() -> None:
    night = Night()
    hellos = [data for data in night.recorded if data[3] == 1]
    box, sensor = linked_box()
    own = sensor.hello()
    box.hear(own)
    box.answers()
    for _ in range(100):
        box.now += 0.02
        box.hear(own, *hellos, origin=STRANGER)
        assert way(box) == "192.168.4.7:2390"
        assert len(box.hear(sensor.reading())) == 1
        assert all(
            to == A or data[3] == 2 for data, to in box.answers()
        )  # an assignment that nobody can use: it is bound to a power-on that is over
    assert way(box) == "192.168.4.7:2390"
    assert box.link.states(box.now)[0].boot_nonce == sensor.boot
    assert box.counted()["old_hello"] >= 99 * 4
    assert box.link.sent["assignment"] <= 2 + len(hellos)


def test_replayed_hellos_do_not_keep_a_sensor_from_being_let_in() -> None:
    night = Night()
    hellos = [data for data in night.recorded if data[3] == 1]
    box = Box()
    sensor = Wearable(KEYS["left-wrist"], boot=9)
    for n in range(200):
        box.now += 0.005
        box.hear(*hellos, origin=STRANGER)
        if n % 100 == 50:
            box.hear(sensor.hello())
        for data, to in box.answers():
            if to == A:
                sensor.hear(data)
    assert len(box.hear(sensor.reading())) == 1


def test_an_hour_of_recorded_hellos_does_not_keep_a_sensor_from_being_let_in() -> None:
    """They were never heard by this box, so each of them is new once; the next one comes with each tick."""
    box = Box()
    before = Wearable(KEYS["left-wrist"], boot=8)
    sensor = Wearable(KEYS["left-wrist"], boot=9)
    for hello in [before.hello() for _ in range(200)]:
        box.now += 0.02
        if sensor.hellos == 0:
            box.hear(sensor.hello())
        box.hear(hello, origin=STRANGER)
        for data, to in box.answers():
            if to == A:
                sensor.hear(data)
    assert len(box.hear(sensor.reading())) == 1


def test_hellos_of_hundreds_of_power_ons_over_and_over_do_not_either() -> None:
    """More power-ons than the box remembers: each of their hellos is new again and again."""
    recorded = [Wearable(KEYS["left-wrist"], boot).hello() for boot in range(1000, 1300)]
    box = Box()
    sensor = Wearable(KEYS["left-wrist"], boot=9)
    for n in range(100):
        box.now += 0.02
        if n == 50:
            box.hear(sensor.hello())
        for at in range(4):
            box.hear(recorded[(4 * n + at) % len(recorded)], origin=STRANGER)
        for data, to in box.answers():
            if to == A:
                sensor.hear(data)
    assert len(box.hear(sensor.reading())) == 1


def test_what_a_linked_sensor_said_of_itself_outlives_hundreds_of_replayed_hellos() -> None:
    box, sensor = linked_box()
    for boot in range(1000, 1600):
        box.hear(Wearable(KEYS["left-wrist"], boot).hello(), origin=STRANGER)
    assert box.link.states(box.now)[0].firmware == "1.2.3"
    assert len(box.hear(sensor.reading())) == 1


def test_a_replayed_reading_does_not_take_the_call_of_a_sensor_whose_box_was_started_anew() -> None:
    replayed = Box().pair(boot=5).reading()
    sensor = Box().pair(boot=6)
    box = Box(now=200.0)
    called_at = []
    for _ in range(50):
        box.now += 0.02
        box.hear(replayed, sensor.reading(), replayed, origin=STRANGER)
        called_at += [box.now for data, _ in box.answers() if data[8:12] == (6).to_bytes(4, "little")]
    assert called_at[0] - 200.0 < 0.03
    assert len(called_at) <= 5
    assert box.link.sent["call"] <= 10


def bytes_in_and_out(box: Box, packets: list[bytes], seconds: float) -> tuple[int, int]:
    came = left = 0
    for _ in range(round(seconds / 0.02)):
        box.now += 0.02
        came += sum(len(packet) for packet in packets)
        box.hear(*packets, origin=STRANGER)
        left += sum(len(data) for data, to in box.answers() if to == STRANGER)
    return came, left


@pytest.mark.parametrize("profiles", [{}, {bytes(range(0x40, 0x50)): bytes(22)}], ids=["bare", "restoring"])
@pytest.mark.parametrize("what", [1, 3, 6], ids=["hellos", "readings", "profiles"])
def test_nobody_gets_more_bytes_than_he_sends(what: int, profiles: dict[bytes, bytes]) -> None:
    """One by one and all together: the box is no amplifier, whatever is replayed to it."""
    recorded = [data for data in Night().recorded if data[3] == what]
    for packet in recorded[:60]:
        box = Box(profiles=profiles)
        box.hear(packet, origin=STRANGER)
        assert sum(len(data) for data, _ in box.answers()) <= len(packet)
    came, left = bytes_in_and_out(Box(profiles=profiles), recorded, 5.0)
    assert left <= came / 10
