"""Packets without the key change nothing: forged, damaged, thrown back, made up. On invented times."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from tests.sensor.peers import KEYS, STRANGER, A, Box, Wearable, believed, linked_box, way


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
