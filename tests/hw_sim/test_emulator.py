"""Emulated sensors on a clock of the test's own, alone and joined to the box's own link."""

from __future__ import annotations

from io import StringIO
from itertools import count, pairwise

import numpy as np
import pytest
from rich.console import Console

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from hw_sim import motions
from hw_sim.casting import cast_sensors
from hw_sim.emulated_sensor import EmulatedSensor, sensor_axes
from hw_sim.emulator import Emulator, Sent
from hw_sim.network import BAD, VENUE, VenueNetwork
from hw_sim.status import StatusLine
from hw_sim.wearer import Wearer
from tests.hw_sim.joined import Show
from tests.hw_sim.tiny_box import KEY, FakeClock, Pair, TinyBox, paired, readings

KEYS = {KEY.name: KEY}
FIRST_READING_S = 0.7


def sensor(motion: motions.Motion | None = None, **options: object) -> EmulatedSensor:
    return EmulatedSensor(KEY, Wearer(motion or motions.still()), **options)  # type: ignore[arg-type]


def stage_axes(orientation: motions.Quaternion) -> motions.Quaternion:
    w, x, y, z = orientation
    return w, y, z, x


def sent_in(device: EmulatedSensor, seconds: float, clock: FakeClock, **options: object) -> list[Sent]:
    """What goes out in real time's own loop, to a box that answers."""
    pair = Pair(device, clock=clock, switched_on=False, **options)  # type: ignore[arg-type]
    pair.emulator.run(seconds)
    return pair.sent


def test_fifty_a_second_on_absolute_deadlines_whatever_the_sleep_adds() -> None:
    clock = FakeClock(oversleep_s=0.003)
    sent = sent_in(sensor(), 60.7, clock)
    assert [s.sample.sequence for s in sent] == list(range(3000))
    for s in sent:
        assert 0 <= s.sent_at - (50.0 + FIRST_READING_S + 0.02 * s.sample.sequence) < 0.0071


def test_a_machine_that_slept_leaves_readings_out_instead_of_bursting() -> None:
    pair = Pair(sensor())
    pair.run(1.0)
    before = len(pair.sent)
    pair.clock.now += 2.0
    pair.emulator.step(pair.clock.now)
    assert len(pair.sent) - before <= 3
    assert pair.sent[-1].sample.sequence == pytest.approx(115, abs=1)


def test_a_drifting_sensor_keeps_its_own_time() -> None:
    heard = Pair(sensor(drift_ppm=1000.0))
    heard.run(100.7)
    sent = heard.sent
    assert len(sent) == pytest.approx(5005, abs=1)
    reading = heard.box.of(wire.Reading)[5004 - 1][1]
    assert isinstance(reading, wire.Reading)
    assert reading.sensor_time_us - 700_000 == 5003 * 20_000
    assert sent[5003].sample.sampled_at - 50.0 == pytest.approx((0.7 + 5003 * 0.02) / 1.001)


def test_the_orientation_follows_the_motion_in_stage_axes() -> None:
    pair = Pair(sensor(motions.turning(seconds_per_turn=2.0)))
    pair.run(1.05)
    half = pair.sent[15]  # half a turn takes a second, and the first reading comes after 0.7 s
    assert half.sample.orientation == pytest.approx(motions.about((0, 1, 0), 3.14159265), abs=1e-6)
    reading = pair.box.of(wire.Reading)[15][1]
    assert isinstance(reading, wire.Reading)
    assert stage_axes(reading.orientation) == pytest.approx(half.sample.orientation, abs=1e-4)
    assert stage_axes(sensor_axes((0.1, 0.2, 0.3, 0.4))) == (0.1, 0.2, 0.3, 0.4)


def test_the_dancer_stands_still_once_heard_and_then_goes_over_into_the_dance() -> None:
    wearer = Wearer(motions.dance(4), stand_still_s=2.0)
    pair = Pair(EmulatedSensor(KEY, wearer))
    pair.box.answers = False
    pair.run(5.0)  # nobody hears: nobody dances
    pair.box.answers = True
    pair.run(6.0)
    orientations = np.array([s.sample.orientation for s in pair.sent])
    still = int((np.abs(orientations[:, 0]) > 1 - 1e-9).sum())
    assert still == pytest.approx(101, abs=1)
    turns = np.degrees(2 * np.arccos(np.clip(np.abs((orientations[1:] * orientations[:-1]).sum(1)), 0, 1)))
    assert turns.max() < 10.0  # no jump: the box's gate would hold it back
    last = pair.sent[-1].sample
    danced = motions.dance(4)(last.sampled_at - pair.sent[0].sample.sampled_at - 2.0)
    assert last.orientation == pytest.approx(danced)


def test_the_same_seed_sends_the_same_but_never_the_same_power_on() -> None:
    def play() -> list[Sent]:
        (device,) = cast_sensors([KEY], lambda number, name: motions.dance(5), seed=5)
        assert isinstance(device, EmulatedSensor)
        return sent_in(device, 20.0, FakeClock(), network=VenueNetwork(BAD, 5))

    first, second = play(), play()
    shown = [[(s.sample.sequence, s.sample.orientation, s.note) for s in sent] for sent in (first, second)]
    assert shown[0] == shown[1]
    assert [s.sent_at for s in first] == [s.sent_at for s in second]
    assert first[0].sample.boot_nonce != second[0].sample.boot_nonce


def test_what_cannot_be_sent_is_counted_and_not_logged() -> None:
    class Torn:
        """A sender that never takes anything."""

        is_up, descriptor = True, None

        def send_packet(self, data: bytes) -> bool:
            return False

        def receive_packet(self) -> bytes | None:
            return None

        def close(self) -> None: ...

    clock = FakeClock()
    sent: list[Sent] = []
    emulator = Emulator([sensor()], [{0: Torn()}], on_sent=sent.append, clock=clock, sleep=clock.sleep)
    emulator.run(1.9)
    assert sent == []
    assert emulator.counts == {"unsent": 4}  # hellos


def test_five_minutes_of_venue_every_reading_believed_and_its_time_known() -> None:
    device = sensor(motions.dance(1), drift_ppm=60.0, device_time_us=2**32 - 30_000_000, boot_nonce=lambda: 9)
    show = Show([device], VenueNetwork(VENUE, 1), KEYS)
    readings = show.run(300)
    counts = {reason: number for reason, number in show.link.counts.items() if number}
    assert set(counts) <= {"hello", "accepted", "lost"}
    assert counts["hello"] <= 2
    assert counts["accepted"] + counts["lost"] == pytest.approx(14_965, abs=3)
    errors_s = [
        reading.measured_at - show.sent[KEY.name, 9, reading.sequence].sample.sampled_at
        for reading in readings
        if reading.arrival > 1030
    ]
    assert min(errors_s) > 0.0010
    assert max(errors_s) < 0.0025


def test_a_bad_night_eight_sensors_with_everything_that_goes_wrong() -> None:
    keys = {f"hand-{n}": SensorKey(f"hand-{n}", n + 1, bytes([n]) * 16) for n in range(8)}
    sensors = cast_sensors(list(keys.values()), lambda n, _: motions.dance(n), seed=3, reboot_every_s=20.0)
    show = Show(sensors, VenueNetwork(BAD, 3), keys)
    newest: dict[str, float] = {}
    for reading in show.run(60):
        made = show.made[reading.sensor, reading.sequence]  # one for each power-on
        heard = stage_axes(reading.orientation)
        assert max(abs(np.dot(orientation, heard)) for orientation in made) > 0.99999
        assert reading.arrival >= newest.get(reading.sensor, 0.0)
        newest[reading.sensor] = reading.arrival
    counts = show.link.counts
    assert counts["reboot"] == sum(device.reboots for device in sensors) == 8 * 2
    assert counts["accepted"] > 0.85 * 8 * (60 - 3 * 0.7 - 2 * 1.5) * 50
    for reason in ("duplicate", "reordered", "tag", "lost"):
        assert counts[reason] > 0, reason
    assert counts["norm"] == 0


def test_a_box_that_is_started_anew_hears_all_eight_again_within_a_moment() -> None:
    keys = {f"hand-{n}": SensorKey(f"hand-{n}", n + 1, bytes([n]) * 16) for n in range(8)}
    sensors = cast_sensors(list(keys.values()), lambda n, _: motions.dance(n), seed=3)
    show = Show(sensors, VenueNetwork(VENUE, 3), keys)
    show.run(5)
    for _ in range(5):
        show.restart_box()
        restarted_at = show.now
        heard = {reading.sensor: reading.arrival for reading in reversed(show.run(3))}
        assert set(heard) == set(keys)
        assert max(heard.values()) - restarted_at < 0.4  # a stall of the network takes half of that


@pytest.mark.parametrize("degrees", [30.0, 40.0])
def test_the_step_for_measuring_is_believed_at_once(degrees: float) -> None:
    (device,) = cast_sensors([KEY], lambda *_: motions.step(degrees=degrees, every_s=0.5), seed=1)
    show = Show([device], VenueNetwork(VENUE, 2), KEYS)
    show.run(60)
    assert {reason for reason, number in show.link.counts.items() if number} <= {"hello", "accepted", "lost"}


def test_a_cable_is_no_network() -> None:
    """Null: the same packets by the network, of which a tenth are late, lost or damaged."""
    trouble = {"lost", "reordered", "duplicated", "corrupted"}
    for by_cable in (True, False):
        pair = Pair(sensor(), network=VenueNetwork(BAD, 3))
        pair.line.is_up, pair.cable.is_up = not by_cable, by_cable
        pair.run(10.0)
        assert len(pair.sent) > 400
        assert bool(trouble & set(pair.emulator.counts)) != by_cable
        assert all(sent.sent_at - sent.sample.sampled_at < 0.005 for sent in pair.sent) == by_cable


def test_a_reboot_is_silent_and_starts_from_zero() -> None:
    nonces = count(1)
    device = sensor(reboot_every_s=5.0, boot_nonce=lambda: next(nonces))
    sent = sent_in(device, 21.0, FakeClock())
    assert {s.sample.boot_nonce for s in sent} == {1, 2, 3, 4}
    second = [s for s in sent if s.sample.boot_nonce == 2]
    first = [s for s in sent if s.sample.boot_nonce == 1]
    assert second[0].sample.sequence == 0
    assert second[0].sent_at - first[-1].sent_at > 1.5 + FIRST_READING_S - 0.001


def test_the_round_trip_is_measured_by_the_echo() -> None:
    pair = paired()
    pair.run(5.0)
    assert readings(pair)[0].round_trip == wire.ROUND_TRIP_UNKNOWN
    assert 0 <= readings(pair)[-1].round_trip < 100  # less than 10 ms on a line without length


def test_the_rate_is_the_one_that_the_box_wants() -> None:
    box = TinyBox()
    box.rate_hz = 100
    pair = paired(box=box)
    pair.run(2.0)
    assert len(readings(pair)) == pytest.approx(130, abs=2)
    times_us = [reading.sensor_time_us for reading in readings(pair)]
    assert {b - a for a, b in pairwise(times_us)} == {10_000}


def test_readings_are_in_the_axes_of_the_sensor() -> None:
    turn = motions.about((0, 1, 0), 0.7)  # stage: about the vertical
    pair = paired(motions.still(turn))
    pair.run(1.0)
    w, x, y, z = readings(pair)[0].orientation
    assert (w, y, z, x) == pytest.approx(turn, abs=1e-4)  # the box's permutation gives it back
    assert sensor_axes(turn)[3] == pytest.approx(turn[2])  # the sensor's vertical is z


def test_double_taps_are_counted() -> None:
    pair = paired()
    pair.run(1.0)
    pair.device.taps += 1
    pair.run(0.1)
    assert (readings(pair)[0].taps, readings(pair)[-1].taps) == (0, 1)


def played(answers: bool = True, is_up: bool = True) -> Emulator:
    """A second of readings, after the start-up of the IMU."""
    pair = Pair(EmulatedSensor(KEY, Wearer(motions.still())))
    pair.box.answers, pair.line.is_up = answers, is_up
    pair.run(1.69)
    return pair.emulator


def test_on_a_terminal_one_line_a_second() -> None:
    out = StringIO()
    emulator = played()
    with StatusLine("box:9750", Console(file=out, force_terminal=True, width=120)) as status:
        status.show(emulator, 100.0)
        drawn = len(out.getvalue())
        status.show(emulator, 100.9)
        assert len(out.getvalue()) == drawn
        status.show(emulator, 101.0)
        assert "left-wrist (light on) -> box:9750" in out.getvalue()[drawn:]
        status.end(emulator)
    assert "50 readings sent" in out.getvalue()


def test_elsewhere_the_first_and_the_last_word() -> None:
    out = StringIO()
    emulator = played()
    with StatusLine("box:9750", Console(file=out, width=100)) as status:
        status.show(emulator, 100.0)
        assert out.getvalue() == "Calling the box at box:9750.\n"
        status.end(emulator)
    assert out.getvalue().endswith("box:9750.\n1 sensor -> box:9750: 50 readings sent\n")


def test_when_nothing_got_out_it_says_what_to_look_at() -> None:
    out = StringIO()
    with StatusLine("/dev/ttyUSB0", Console(file=out, width=100)) as status:
        status.end(played(is_up=False))
    assert "Nothing could be sent to /dev/ttyUSB0" in out.getvalue()


def test_when_no_box_took_the_sensors_it_says_what_to_look_at() -> None:
    out = StringIO()
    with StatusLine("box:9750", Console(file=out, width=100)) as status:
        status.end(played(answers=False))
    assert "No box took these sensors at box:9750" in out.getvalue()
    assert "the same key file" in out.getvalue()
