"""The link's judgement, datagram by datagram, on invented times: new, stale, believed or not."""

from __future__ import annotations

import random
from collections import Counter, deque
from itertools import pairwise
from math import cos, radians, sin

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import BOOT_SILENCE_S, DATAGRAMS_PER_DRAIN, SensorLink, SensorReading

KEYS = {
    "left-wrist": SensorKey("left-wrist", 0x11, bytes(range(16))),
    "head": SensorKey("head", 0x22, bytes(range(16, 32))),
}


class Queue:
    """An intake without a network: what is put in comes out."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.waiting: deque[tuple[bytes, float]] = deque()

    def receive(self, now: float) -> tuple[bytes, float] | None:
        return self.waiting.popleft() if self.waiting else None

    def close(self) -> None:
        self.waiting.clear()


class Stage:
    """A link, and sensors that speak to it."""

    def __init__(self) -> None:
        self.queue = Queue()
        self.link = SensorLink(KEYS, [self.queue])
        self.now = 100.0

    def hear(self, *datagrams: bytes) -> tuple[SensorReading, ...]:
        self.queue.waiting.extend((datagram, self.now) for datagram in datagrams)
        return tuple(self.link.drain(self.now))

    def counted(self) -> dict[str, int]:
        return {reason: count for reason, count in self.link.counts.items() if count}


def datagram(
    sequence: int,
    *,
    sensor: str = "left-wrist",
    boot: int = 1,
    degrees: float = 0.0,
    time_us: int | None = None,
) -> bytes:
    half = radians(degrees) / 2
    orientation = (cos(half), sin(half), 0.0, 0.0)
    key = KEYS[sensor]
    moment_us = 20_000 * sequence if time_us is None else time_us
    reading = wire.Reading(key.device_id, boot, 0, sequence, moment_us, orientation, 0x3C, 80, 0, 0, 0, 0)
    return wire.pack(reading, wire.Tagger(key.key))


def test_a_reading_arrives_with_all_that_it_carries() -> None:
    stage = Stage()
    (reading,) = stage.hear(datagram(7, degrees=30))
    assert reading.sensor == "left-wrist"
    assert reading.orientation == pytest.approx((cos(radians(15)), sin(radians(15)), 0, 0), abs=1e-4)
    assert (reading.sequence, reading.sensor_time_us, reading.battery, reading.calibration) == (
        7,
        140_000,
        80,
        0x3C,
    )
    assert reading.arrival == reading.measured_at == stage.now
    assert stage.link.newest_arrival("left-wrist") == stage.now
    assert stage.link.newest_arrival("head") is None
    assert stage.hear() == ()


def test_the_newest_of_a_burst_wins_for_each_sensor() -> None:
    stage = Stage()
    burst = [datagram(n, sensor=sensor) for n in range(12) for sensor in KEYS]
    assert {reading.sensor: reading.sequence for reading in stage.hear(*burst)} == {
        "left-wrist": 11,
        "head": 11,
    }
    assert stage.counted() == {"accepted": 24}


def test_every_believed_arrival_of_a_drain_is_kept_for_the_phase() -> None:
    stage = Stage()
    stage.queue.waiting.extend(
        [(datagram(0), 99.95), (datagram(1), 99.97), (datagram(2, degrees=170), 99.99)]
    )
    stage.hear(datagram(3))
    assert list(stage.link.arrivals("left-wrist")) == [99.95, 99.97, 100.0]
    assert list(stage.link.arrivals("nobody")) == []
    stage.hear()
    assert list(stage.link.arrivals("left-wrist")) == []


def test_overtaken_repeated_and_long_gone_readings_are_told_apart() -> None:
    stage = Stage()
    stage.hear(datagram(100), datagram(103))
    assert stage.hear(datagram(103), datagram(100), datagram(101), datagram(103 - 64)) == ()
    assert stage.counted() == {"accepted": 2, "lost": 2, "duplicate": 2, "reordered": 1, "old": 1}


def test_within_one_drain_an_overtaken_reading_does_not_win() -> None:
    stage = Stage()
    (reading,) = stage.hear(datagram(1), datagram(3), datagram(2))
    assert reading.sequence == 3


def test_the_sign_is_continuous_whatever_the_sensor_sends() -> None:
    stage = Stage()
    previous = None
    for n in range(200):
        (reading,) = stage.hear(datagram(n, degrees=(20 * n) % 360))
        if previous is not None:
            assert sum(a * b for a, b in zip(previous, reading.orientation, strict=True)) > 0
        previous = reading.orientation


def test_a_reboot_is_followed_when_the_old_boot_is_silent() -> None:
    stage = Stage()
    stage.hear(datagram(5000, boot=1))
    stage.now += 2.0
    (reading,) = stage.hear(datagram(0, boot=2, degrees=170))
    assert reading.sequence == 0
    assert stage.counted() == {"accepted": 2, "reboot": 1}
    stage.now += 0.1
    assert stage.hear(datagram(5000, boot=1)) == ()
    stage.now += 2.0
    assert stage.hear(datagram(4999, boot=1), datagram(5000, boot=1)) == ()
    assert stage.counted()["old_boot"] == 3


def test_another_nights_recording_cannot_push_out_a_sensor_that_is_heard() -> None:
    stage = Stage()
    for n in range(100):
        stage.now += 0.02
        assert [r.sequence for r in stage.hear(datagram(n, boot=1), datagram(n, boot=666, degrees=90))] == [n]
    assert stage.counted() == {"accepted": 100, "boot_overlap": 100}


def test_a_sensor_comes_back_after_a_recording_was_played_into_its_silence() -> None:
    stage = Stage()
    stage.hear(datagram(10, boot=1))
    stage.now += 1.0
    assert stage.hear(datagram(500, boot=666)) != ()  # the limit that pairing will close
    stage.now += BOOT_SILENCE_S + 0.1
    assert [reading.sequence for reading in stage.hear(datagram(90, boot=1))] == [90]
    stage.now += BOOT_SILENCE_S + 0.1
    assert stage.hear(datagram(500, boot=666)) == ()


def test_only_a_believed_reading_makes_a_sensor_young() -> None:
    stage = Stage()
    stage.hear(datagram(1))
    stage.now += 0.02
    assert stage.hear(datagram(2, degrees=170)) == ()
    assert stage.link.newest_arrival("left-wrist") == 100.0
    assert stage.counted() == {"accepted": 1, "rate": 1}


def test_device_time_wraps_under_way() -> None:
    stage = Stage()
    times_us = []
    for n in range(100):
        stage.now += 0.02
        (reading,) = stage.hear(datagram(n, degrees=30 * n, time_us=(2**32 - 1_000_000 + 20_000 * n) % 2**32))
        times_us.append(reading.sensor_time_us)
    assert {b - a for a, b in pairwise(times_us)} == {20_000}


def test_a_flood_takes_a_bounded_share_of_a_tick_and_passes() -> None:
    stage = Stage()
    stage.queue.waiting.extend((b"x" * 42, stage.now) for _ in range(1000))
    stage.link.drain(stage.now)
    assert len(stage.queue.waiting) == 1000 - DATAGRAMS_PER_DRAIN
    for _ in range(8):
        stage.link.drain(stage.now)
    assert [reading.sequence for reading in stage.hear(datagram(1))] == [1]
    assert stage.counted() == {"magic": 1000, "drain_limit": 7, "accepted": 1}


def test_packets_of_other_kinds_are_counted() -> None:
    stage = Stage()
    key = KEYS["head"]
    heartbeat = wire.Heartbeat(key.device_id, 1, 0, 1, 0, 0, 1)
    assert stage.hear(wire.pack(heartbeat, wire.Tagger(key.key))) == ()
    assert stage.counted() == {"kind": 1}


def test_one_sensors_key_does_not_speak_for_another() -> None:
    stage = Stage()
    reading = wire.Reading(KEYS["head"].device_id, 1, 0, 1, 0, (1.0, 0.0, 0.0, 0.0), 0, 0, 0, 0, 0, 0)
    assert stage.hear(wire.pack(reading, wire.Tagger(KEYS["left-wrist"].key))) == ()
    assert stage.counted() == {"tag": 1}


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
            at = rng.randrange(4, len(data))
            data[at : at + 4] = rng.randbytes(4)
        case 4:
            data[16:20] = rng.randrange(2**32).to_bytes(4, "little")
        case 5:
            data[-8:] = rng.randbytes(8)
        case _:
            data = bytearray(rng.randbytes(rng.choice([0, 1, 8, 20, 35, 42, 42, 42, 52, 1400])))
    return bytes(data)


def test_a_hundred_thousand_random_and_mutated_datagrams_none_accepted_and_the_show_unmoved() -> None:
    rng = random.Random(2026)
    stage = Stage()
    good = [datagram(n, sensor=sensor) for sensor in KEYS for n in range(50, 70)]
    bad = 0
    accepted = 0
    while bad < 100_000:
        batch = [mutated(rng, rng.choice(good)) for _ in range(100)]
        batch = [data for data in batch if data not in good]
        bad += len(batch)
        assert stage.hear(*batch) == ()
        if bad % 10_000 < 100:  # the real sensor is still heard in between
            stage.now += 0.02
            accepted += 1
            assert len(stage.hear(datagram(1000 + accepted))) == 1
    counts = stage.counted()
    assert counts.pop("accepted") == accepted
    counts.pop("lost", None)
    assert sum(counts.values()) == bad
    assert {"length", "magic", "version", "kind", "device", "tag"} <= counts.keys()


def test_a_genuine_packet_with_any_payload_never_raises() -> None:
    rng = random.Random(7)
    stage = Stage()
    tagger = wire.Tagger(KEYS["head"].key)
    signed = datagram(0, sensor="head")[: wire.READING.signed_bytes]
    for n in range(5000):
        body = signed[:8] + rng.randbytes(4) + signed[12:16] + n.to_bytes(4, "little") + rng.randbytes(14)
        stage.now += rng.choice([0.0, 0.02, 0.7, 6000.0])
        stage.hear(body + tagger.tag(body))
    assert sum(stage.link.counts[reason] for reason in ("accepted", "relocated")) < 5000


def test_readings_cannot_be_changed_by_whoever_gets_them() -> None:
    stage = Stage()
    (reading,) = stage.hear(datagram(1))
    with pytest.raises(AttributeError):
        reading.sequence = 2  # type: ignore[misc]
