"""Emulated sensors and the box's link, joined on an invented clock: minutes of a show in a second."""

from __future__ import annotations

from collections import defaultdict
from itertools import count

import numpy as np
import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorReading
from hw_sim import motions
from hw_sim.casting import cast_sensors
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator, Sent
from hw_sim.network import BAD, VENUE, VenueNetwork
from tests.sensor.test_link import KEYS, Queue, SensorLink

KEY = KEYS["left-wrist"]


class FakeClock:
    """A monotonic clock that sleeping moves on, always a little further than asked for."""

    def __init__(self, oversleep_s: float = 0.0001) -> None:
        self.now = 50.0
        self.oversleep_s = oversleep_s

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds + self.oversleep_s


def sent_by(sensor: EmulatedSensor, seconds: float, clock: FakeClock, **options: object) -> list[Sent]:
    sent: list[Sent] = []
    emulator = Emulator(
        [sensor],
        lambda data: True,
        on_sent=sent.append,
        clock=clock,
        sleep=clock.sleep,
        **options,  # type: ignore[arg-type]
    )
    emulator.run(seconds)
    return sent


def test_fifty_a_second_on_absolute_deadlines_whatever_the_sleep_adds() -> None:
    clock = FakeClock(oversleep_s=0.003)
    sent = sent_by(EmulatedSensor(KEY, motions.still()), 60.0, clock)
    assert [s.sample.sequence for s in sent] == list(range(3000))
    for s in sent:
        assert 0 <= s.sent_at - (50.0 + 0.02 * s.sample.sequence) < 0.0071


def test_a_machine_that_slept_leaves_readings_out_instead_of_bursting() -> None:
    clock = FakeClock()
    sent: list[Sent] = []
    emulator = Emulator(
        [EmulatedSensor(KEY, motions.still())], lambda data: True, on_sent=sent.append, clock=clock
    )
    emulator.start(50.0)
    emulator.step(50.0)
    clock.now = 60.0
    emulator.step(60.0)
    assert len(sent) <= 3
    assert sent[-1].sample.sequence == 500


def test_a_drifting_sensor_keeps_its_own_time() -> None:
    sensor = EmulatedSensor(KEY, motions.still(), drift_ppm=1000.0)
    sent = sent_by(sensor, 100.0, FakeClock())
    assert len(sent) == 5005
    reading = wire.unpack(sent[-1].sample.datagram, lambda _: wire.Tagger(KEY.key))
    assert isinstance(reading, wire.Reading)
    assert reading.sensor_time_us - 700_000 == 5004 * 20_000
    assert sent[-1].sample.sampled_at - 50.0 == pytest.approx(5004 * 0.02 / 1.001)


def test_the_clock_and_the_orientation_follow_the_motion() -> None:
    sent = sent_by(EmulatedSensor(KEY, motions.turning(seconds_per_turn=2.0)), 1.0, FakeClock())
    assert sent[25].sample.orientation == pytest.approx(motions.about((0, 1, 0), 3.14159265 / 2))


def test_the_same_seed_sends_the_same_but_never_the_same_power_on() -> None:
    def play() -> list[Sent]:
        (sensor,) = cast_sensors([KEY], lambda number, name: motions.dance(5), seed=5)
        return sent_by(sensor, 20.0, FakeClock(), network=VenueNetwork(BAD, 5))

    first, second = play(), play()
    shown = [[(s.sample.sequence, s.sample.orientation, s.note) for s in sent] for sent in (first, second)]
    assert shown[0] == shown[1]
    assert [s.sent_at for s in first] == [s.sent_at for s in second]
    assert first[0].sample.boot_nonce != second[0].sample.boot_nonce


def test_what_cannot_be_sent_is_counted_and_not_logged() -> None:
    clock = FakeClock()
    sent: list[Sent] = []
    sensor = EmulatedSensor(KEY, motions.still())
    emulator = Emulator([sensor], lambda data: False, on_sent=sent.append, clock=clock, sleep=clock.sleep)
    emulator.run(1.0)
    assert sent == []
    assert emulator.counts == {"unsent": 50}


class Show:
    """Emulator, network and link on one clock; the box drains every 20 ms, a datagram has its own arrival."""

    def __init__(
        self, sensors: list[EmulatedSensor], network: VenueNetwork, keys: dict[str, SensorKey]
    ) -> None:
        self.queue = Queue()
        self.link = SensorLink(keys, [self.queue])
        self.sent: dict[tuple[str, int, int], Sent] = {}
        self.made: dict[tuple[str, int], set[motions.Quaternion]] = defaultdict(set)
        self.now = 1000.0
        self.emulator = Emulator(
            sensors, self._send, network=network, on_sent=self._note, clock=lambda: self.now
        )
        self.emulator.start(self.now)

    def run(self, seconds: float) -> list[SensorReading]:
        readings: list[SensorReading] = []
        due = self.now
        for tick in range(1, int(seconds * 50) + 1):
            tick_at = 1000.007 + tick * 0.02
            while due <= tick_at:
                self.now = due
                due = max(self.emulator.step(due), due + 1e-6)
            self.now = tick_at
            readings += self.link.drain(tick_at)
        return readings

    def _send(self, data: bytes) -> bool:
        self.queue.waiting.append((data, self.now))
        return True

    def _note(self, sent: Sent) -> None:
        sample = sent.sample
        self.sent[sample.sensor, sample.boot_nonce, sample.sequence] = sent
        self.made[sample.sensor, sample.sequence].add(sample.orientation)


def test_five_minutes_of_venue_every_reading_believed_and_its_time_known() -> None:
    sensor = EmulatedSensor(
        KEY, motions.dance(1), drift_ppm=60.0, device_time_us=2**32 - 30_000_000, boot_nonce=lambda: 9
    )
    show = Show([sensor], VenueNetwork(VENUE, 1), KEYS)
    readings = show.run(300)
    counts = {reason: number for reason, number in show.link.counts.items() if number}
    assert set(counts) == {"accepted", "lost"}
    assert counts["accepted"] + counts["lost"] == pytest.approx(15_000, abs=3)
    errors_s = [
        reading.measured_at - show.sent["left-wrist", 9, reading.sequence].sample.sampled_at
        for reading in readings
        if reading.arrival > 1030
    ]
    assert min(errors_s) > 0.0010
    assert max(errors_s) < 0.0025


def test_a_bad_night_eight_sensors_with_everything_that_goes_wrong() -> None:
    keys = {f"hand-{n}": SensorKey(f"hand-{n}", n + 1, bytes([n]) * 16) for n in range(8)}
    sensors = cast_sensors(list(keys.values()), lambda n, _: motions.dance(n), seed=3, reboot_every_s=20.0)
    show = Show(sensors, VenueNetwork(BAD, 3), keys)
    newest: dict[str, tuple[float, int]] = {}
    for reading in show.run(60):
        made = show.made[reading.sensor, reading.sequence]  # one for each power-on
        assert max(abs(np.dot(orientation, reading.orientation)) for orientation in made) > 0.99999
        assert reading.arrival >= newest.get(reading.sensor, (0.0, 0))[0]
        newest[reading.sensor] = (reading.arrival, reading.sequence)
    counts = show.link.counts
    assert counts["reboot"] == sum(sensor.reboots for sensor in sensors) >= 8 * 2 - 1
    assert counts["accepted"] > 0.9 * 8 * 60 * 50 * 0.9
    for reason in ("duplicate", "reordered", "tag", "lost"):
        assert counts[reason] > 0, reason
    assert counts["rate"] + counts["norm"] + counts["torn"] + counts["zero"] == 0


@pytest.mark.parametrize("degrees", [30.0, 40.0])
def test_the_step_for_measuring_is_believed_at_once(degrees: float) -> None:
    (sensor,) = cast_sensors([KEY], lambda *_: motions.step(degrees=degrees, every_s=0.5), seed=1)
    show = Show([sensor], VenueNetwork(VENUE, 2), KEYS)
    show.run(60)
    assert {reason for reason, number in show.link.counts.items() if number} <= {"accepted", "lost"}


def test_a_reboot_is_silent_and_starts_from_zero() -> None:
    nonces = count(1)
    sensor = EmulatedSensor(KEY, motions.still(), reboot_every_s=5.0, boot_nonce=lambda: next(nonces))
    sent = sent_by(sensor, 20.0, FakeClock())
    boots = {s.sample.boot_nonce for s in sent}
    assert boots == {1, 2, 3, 4}
    second = [s for s in sent if s.sample.boot_nonce == 2]
    first = [s for s in sent if s.sample.boot_nonce == 1]
    assert second[0].sample.sequence == 0
    assert second[0].sent_at - first[-1].sent_at > 1.4
