"""Packets without the key change nothing: forged, damaged, thrown back, made up. On invented times."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from tests.sensor.peers import KEYS, STRANGER, A, B, Box, Wearable, believed, linked_box, way


def a_packet_of_each_kind(sensor: Wearable) -> dict[str, bytes]:
    """New, genuine, for the session in force: what the sensor sends and what the box sends."""
    head = sensor.key.device_id, sensor.boot, sensor.session, 1000
    from_box = {
        "Assignment": wire.Assignment(*head, hello_sequence=sensor.hellos, hand=0, rate_hz=50, led=1),
        "Heartbeat": wire.Heartbeat(*head, echo_sequence=1, echo_held_us=1, led=1),
        "Call": wire.Call(*head),
        "Restore": wire.Restore(*head, imu_id=bytes(16), offsets=bytes(22)),
    }
    return {"Hello": sensor.hello(), "Reading": sensor.reading(), "Profile": sensor.profile()} | {
        kind: wire.pack(packet, sensor.tagger) for kind, packet in from_box.items()
    }


KINDS = tuple(layout.name for layout in wire.LAYOUTS.values())


@pytest.mark.parametrize("kind", KINDS)
def test_every_single_flipped_bit_of_every_kind_is_refused_and_answers_nothing(kind: str) -> None:
    box, sensor = linked_box()
    genuine = a_packet_of_each_kind(sensor)[kind]
    before = believed(box)
    for bit in range(8 * len(genuine)):
        damaged = bytearray(genuine)
        damaged[bit // 8] ^= 1 << bit % 8
        assert box.hear(bytes(damaged), origin=STRANGER) == ()
        assert box.answers() == []
    assert believed(box) == before
    assert way(box) == "192.168.4.7:2390"
    assert sum(box.counted().values()) == sum(before.values()) + 8 * len(genuine)


@pytest.mark.parametrize("kind", KINDS)
def test_truncated_and_lengthened_packets_of_every_kind_are_refused(kind: str) -> None:
    box, sensor = linked_box()
    genuine = a_packet_of_each_kind(sensor)[kind]
    before = believed(box)
    for length in range(1, len(genuine)):
        box.hear(genuine[:length], genuine[length:], origin=STRANGER)
    for more in range(1, 80):
        box.hear(genuine + bytes(more), origin=STRANGER)
    assert box.answers() == []
    assert believed(box) == before


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_signed_with_another_key_is_refused(kind: str) -> None:
    box, sensor = linked_box()
    forger = Wearable(SensorKey("left-wrist", sensor.key.device_id, bytes(16)))
    forger.session, forger.sequence, forger.hellos = sensor.session, 5000, 5000
    before = believed(box)
    assert box.hear(a_packet_of_each_kind(forger)[kind], origin=STRANGER) == ()
    assert box.answers() == []
    assert believed(box) == before
    assert way(box) == "192.168.4.7:2390"


def test_one_sensors_key_does_not_speak_for_another() -> None:
    box, wrist = linked_box()
    head = KEYS["head"]
    for packet in a_packet_of_each_kind(wrist).values():
        signed = packet[:4] + head.device_id.to_bytes(4, "little") + packet[8 : -wire.TAG_BYTES]
        box.hear(signed + wrist.tagger.tag(signed), origin=STRANGER)
    assert box.answers() == []
    assert [one.state for one in box.link.states(box.now)] == ["linked", "absent"]


def test_what_the_box_sends_is_worth_nothing_when_it_comes_back() -> None:
    box = Box(profiles={bytes(range(0x40, 0x50)): bytes(22)})
    sensor = Wearable(KEYS["left-wrist"])
    box.hear(Box().pair().reading())  # makes the box call
    box.hear(sensor.hello())
    sent = [data for data, _ in box.answers()]
    sensor.session = wire.unpack(sent[0], lambda _: sensor.tagger).session
    box.hear(sensor.reading())
    sent += [data for data, _ in box.answers()]
    assert {data[3] for data in sent} == {2, 4, 5, 7}  # every kind that a box sends
    before = box.counted()
    for origin in (A, STRANGER):
        box.hear(*sent, origin=origin)
    box.now += 0.5
    assert box.answers() == []
    assert box.counted() == before | {"kind": 2 * len(sent)}


def test_strangers_are_never_answered() -> None:
    box = Box()
    stranger = Wearable(SensorKey("stranger", 0x33, bytes(16)))
    for _ in range(100):
        box.now += 0.1
        box.hear(stranger.hello(), stranger.reading(), stranger.profile(), origin=STRANGER)
        assert box.answers() == []
    assert box.counted() == {"device": 300}


def mutated(rng: random.Random, good: bytes) -> bytes:
    """A datagram that is not `good` any more, damaged in one of the ways of networks and of people."""
    data = bytearray(good)
    match rng.randrange(7):
        case 0:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        case 1:
            del data[rng.randrange(len(data)) :]
        case 2:
            data += rng.randbytes(rng.randrange(1, 60))
        case 3:
            at = rng.randrange(4, len(data) - 4)
            data[at : at + 4] = rng.randbytes(4)
        case 4:
            data[16:20] = rng.randrange(2**32).to_bytes(4, "little")
        case 5:
            data[-8:] = rng.randbytes(8)
        case _:
            sizes = [layout.size for layout in wire.LAYOUTS.values()]
            data = bytearray(rng.randbytes(rng.choice([0, 1, 8, 20, *sizes, 1400])))
    return bytes(data)


def test_a_hundred_thousand_random_and_mutated_datagrams_none_accepted_and_the_show_unmoved() -> None:
    rng = random.Random(2026)
    box = Box()
    sensor, other = box.pair(), box.pair("head")
    good = [one.numbered(n) for one in (sensor, other) for n in range(50, 60)]
    good += [packet for one in (sensor, other) for packet in a_packet_of_each_kind(one).values()]
    before = believed(box)
    bad = accepted = 0
    while bad < 100_000:
        batch = [mutated(rng, rng.choice(good)) for _ in range(100)]
        batch = [data for data in batch if data not in good]
        bad += len(batch)
        assert box.hear(*batch, origin=STRANGER) == ()
        if bad % 10_000 < 100:  # the real sensor is still heard in between
            box.now += 0.02
            accepted += 1
            assert len(box.hear(sensor.numbered(1000 + accepted))) == 1
            assert all(to == A for _, to in box.answers())
    counts = box.counted()
    assert counts.pop("accepted") == accepted
    counts.pop("lost", None)
    assert counts.pop("hello") == before["hello"]
    assert sum(counts.values()) == bad
    assert {"length", "magic", "version", "kind", "device", "tag", "old_session"} <= counts.keys()


@settings(deadline=None)
@given(st.lists(st.binary(max_size=120), max_size=30))
def test_no_bytes_raise_move_or_are_answered(packets: list[bytes]) -> None:
    box, sensor = linked_box()
    assert box.hear(*packets, origin=STRANGER) == ()
    assert box.answers() == []
    assert [one.sequence for one in box.hear(sensor.reading())] == [sensor.sequence]


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


class Air:
    """A sensor and a box with a storm between them: packets come late, twice, never, or from elsewhere."""

    def __init__(self) -> None:
        self.box = Box()
        self.boots = 1
        self.sensor = Wearable(KEYS["left-wrist"], self.boots)
        self.to_box: list[bytes] = []
        self.to_sensor: list[bytes] = []
        self.newest: dict[int, int] = {}
        self.order: list[int] = []

    def say(self, make: Callable[[Wearable], bytes]) -> None:
        self.to_box.append(make(self.sensor))

    def carry(self, which: int, origin: tuple[str, int]) -> None:
        if not self.to_box:
            return
        for reading in self.box.hear(self.to_box[-1 - which % len(self.to_box)], origin=origin):
            assert reading.sequence > self.newest.get(reading.boot_nonce, 0)
            self.newest[reading.boot_nonce] = reading.sequence
            if reading.boot_nonce not in self.order:
                self.order.append(reading.boot_nonce)
            assert reading.boot_nonce == self.order[-1]  # a power-on that another has followed stays gone
        self.to_sensor += [data for data, _ in self.box.answers()]

    def answer(self, which: int) -> None:
        if not self.to_sensor:
            return
        packet = wire.unpack(self.to_sensor[-1 - which % len(self.to_sensor)], lambda _: self.sensor.tagger)
        if isinstance(packet, wire.Assignment) and packet.boot_nonce == self.sensor.boot:
            self.sensor.session = packet.session

    def restart_sensor(self) -> None:
        self.boots += 1
        self.sensor = Wearable(KEYS["left-wrist"], self.boots)


recent = st.one_of(st.integers(0, 2), st.integers(0, 100))
makes = st.sampled_from([Wearable.hello, Wearable.reading, Wearable.reading, Wearable.profile])
steps = st.one_of(
    st.tuples(st.just("say"), makes, st.booleans()),
    st.tuples(st.just("carry"), recent, st.sampled_from([A, B, STRANGER])),
    st.tuples(st.just("answer"), recent),
    st.tuples(st.just("pair")),
    st.tuples(st.just("reboot")),
    st.tuples(st.just("wait"), st.sampled_from([0.02, 0.15, 0.6, 4.0])),
)


@settings(
    max_examples=200, suppress_health_check=[HealthCheck.large_base_example, HealthCheck.data_too_large]
)
@given(st.lists(steps, min_size=40, max_size=100))
def test_authentic_packets_in_any_order_never_raise_and_never_go_back(script: list[tuple[Any, ...]]) -> None:
    air = Air()
    for what, *arguments in script:
        match what:
            case "say":
                make, arrives = arguments
                air.say(make)
                if arrives:
                    air.carry(0, A)
            case "pair":
                air.box.now += 0.2
                air.say(Wearable.hello)
                air.carry(0, A)
                air.answer(0)
            case "carry":
                air.carry(*arguments)
            case "answer":
                air.answer(*arguments)
            case "reboot":
                air.restart_sensor()
            case "wait":
                air.box.now += arguments[0]
                air.to_sensor += [data for data, _ in air.box.answers()]
        air.box.link.states(air.box.now)
