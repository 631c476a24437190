"""The compiled firmware as a device of the emulator: provisioned by its console, paired, repeatable."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from math import pi
from pathlib import Path

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey, create_keys, load_keys
from appliance.sensor.link import open_link
from hw_sim import motions
from hw_sim.device import Lane, Outgoing
from hw_sim.firmware import BOX, NETWORK, PASSWORD, FirmwareSensor, ask, provision
from hw_sim.firmware_library import IMUS, CompiledWearable, FirmwareMissingError, State, load_library
from hw_sim.network import VENUE, VenueNetwork
from hw_sim.wearer import Wearer
from tests.hw_sim.conftest import Emulate
from tests.hw_sim.joined import Show
from tests.hw_sim.null_modem import NullModem
from tests.hw_sim.test_emulate_command import hear_until, port_of

KEY = SensorKey("left-wrist", 0x0A0B0C0D, bytes(range(16)))
SECOND_US = 1_000_000


def keys_of(*names: str) -> dict[str, SensorKey]:
    return {name: SensorKey(name, 100 + place, bytes([place] * 16)) for place, name in enumerate(names)}


def device(key: SensorKey = KEY, seed: int = 1, imu: str = IMUS[0], **options: float) -> FirmwareSensor:
    return FirmwareSensor(key, Wearer(motions.dance(seed)), seed=seed, imu=imu, **options)


@pytest.fixture
def wearable() -> Iterator[CompiledWearable]:
    """Provisioned, off, in reach of its network."""
    wearable = CompiledWearable(provision(KEY), seed=3)
    wearable.set_network(NETWORK, PASSWORD)
    wearable.set_access_point(True, 0)
    yield wearable
    wearable.close()


def hellos_of(wearable: CompiledWearable) -> list[wire.Hello]:
    packets = [
        wire.unpack(sent.data, lambda device: wire.Tagger(KEY.key)) for sent in wearable.take_datagrams()
    ]
    return [packet for packet in packets if isinstance(packet, wire.Hello)]


def test_a_reading_of_the_second_hour_is_logged_at_its_moment() -> None:
    """Its clock began anew after 72 minutes: the log said that it was measured before that."""
    sensor, measured_at = device(drift_ppm=50.0), 4999.99
    sensor.start(0.0)
    sensor._now = 5000.0
    device_us = round(measured_at * (1 + 50e-6) * 1e6)
    reading = wire.Reading(KEY.device_id, 1, 1, 7, device_us % (1 << 32), (1, 0, 0, 0), 0xFF, 87, 0, 0, 0, 0)
    sample = sensor._sample(wire.pack(reading, wire.Tagger(KEY.key)))
    sensor.close()
    assert device_us > 1 << 32 and sample.sampled_at == pytest.approx(measured_at, abs=1e-4)
    assert sample.orientation == pytest.approx(motions.dance(1)(measured_at), abs=1e-3)


def test_without_the_library_it_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(FirmwareMissingError, match=r"make firmware.*apt-get install -y cmake g\+\+ make"):
        load_library(tmp_path / "libwearable.so")


def test_the_simulation_imports_and_the_other_sensors_work_without_the_library(tmp_path: Path) -> None:
    script = (
        "import pathlib, hw_sim.firmware_library as library;"
        "library.load_library.__wrapped__.__defaults__ = (pathlib.Path('/none'),);"
        "import hw_sim.commands; from hw_sim.__main__ import main;"
        f"main(['emulate', '--keys', {str(tmp_path / 'k')!r}, '--seconds', '0.1', *sys.argv[1:]])"
    )
    for options, status in (([], 1), (["--firmware"], 2)):
        command = [sys.executable, "-c", "import sys;" + script, *options]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert ended.returncode == status, ended.stderr
    assert ended.stderr.startswith("bunraku emulate: the firmware was not compiled")
    assert len(ended.stderr.splitlines()) == 1


@pytest.mark.parametrize("imu", IMUS)
def test_its_readings_are_believed_and_say_how_the_hand_stands(imu: str) -> None:
    keys = keys_of("left-wrist", "head")
    devices = [device(key, seed, imu) for seed, key in enumerate(keys.values(), start=1)]
    show = Show(devices, VenueNetwork(VENUE, 1), keys)
    show.run(5.0)  # joins its network, starts its IMU
    readings = show.run(10.0)
    show.emulator.close()
    for name in keys:
        own = [reading for reading in readings if reading.sensor == name]
        assert len(own) > 0.9 * 500
        truths = [show.sent[name, reading.boot_nonce, reading.sequence].sample for reading in own]
        # As the hand turned since the first reading: the heading at the IMU's start is nobody's choice.
        first, last = own[0], own[-1]
        turned = motions.multiply(motions.inverse(first.orientation), last.orientation)
        true = [motions.inverse(truths[0].orientation), truths[-1].orientation]
        w, x, y, z = motions.multiply(true[0], true[1])
        alike = sum(a * b for a, b in zip(turned, (w, z, x, y), strict=True))
        assert abs(alike) > 0.997  # 9 degrees: 10 ms of the hand at either end
        ages_s = [one.arrival - truth.sampled_at for one, truth in zip(own, truths, strict=True)]
        assert min(ages_s) > 0.0
        assert max(ages_s) < 0.3


class ScriptedBox:
    """Assigns every hello to the same session and beats each second: a box without chance."""

    def __init__(self, rate_hz: int = 50) -> None:
        self._tagger = wire.Tagger(KEY.key)
        self._rate_hz = rate_hz
        self._sequence = 0
        self._boot_nonce = 0

    def answer(self, packet: Outgoing) -> bytes | None:
        _, _, kind, device, self._boot_nonce, _, sequence = wire.HEAD.unpack_from(packet.data)
        if wire.LAYOUTS[kind].name != "Hello":
            return None
        self._sequence += 1
        head = device, self._boot_nonce, 0x5E55, self._sequence
        return wire.pack(wire.Assignment(*head, sequence, 0, self._rate_hz, wire.LED_ON), self._tagger)

    def heartbeat(self) -> bytes:
        self._sequence += 1
        head = KEY.device_id, self._boot_nonce, 0x5E55, self._sequence
        return wire.pack(wire.Heartbeat(*head, 0, 0, wire.LED_SLOW), self._tagger)


def course(
    seed: int, lane: Lane = Lane.NETWORK, seconds: int = 12, rate_hz: int = 50, imu: str = IMUS[0]
) -> tuple[FirmwareSensor, list[Outgoing]]:
    """A device without other sensors and a scripted box, and all that it sent."""
    one, box, sent = device(seed=seed, imu=imu), ScriptedBox(rate_hz), []
    one.start(50.0)
    one.connect(lane, True, 50.0)
    for step in range(1, 100 * seconds):
        now = 50.0 + 0.01 * step
        for packet in one.step(now):
            sent.append(packet)
            answer = box.answer(packet)
            if answer is not None:
                one.receive_packet(answer, now, lane)
        if step % 100 == 0:
            one.receive_packet(box.heartbeat(), now, lane)
    return one, sent


def test_the_same_seed_gives_the_same_bytes_at_the_same_times() -> None:
    (_, first), (_, second), (_, other) = course(7), course(7), course(8)
    assert sum(packet.sample is not None for packet in first) > 400
    assert first == second
    assert first != other


@pytest.mark.parametrize("imu", IMUS)
@pytest.mark.parametrize("rate_hz", [50, 100])
def test_each_inertial_unit_gives_as_many_readings_as_the_box_asks_for(imu: str, rate_hz: int) -> None:
    one, sent = course(5, Lane.CABLE, seconds=10, rate_hz=rate_hz, imu=imu)
    one.close()
    at = [packet.sample.sampled_at for packet in sent if packet.sample is not None]
    dancing = [late - early for early, late in pairwise(at) if early > 55.0]
    assert len(dancing) > 4.5 * rate_hz
    assert max(dancing) < 1.7 / rate_hz
    assert abs(sum(dancing) / len(dancing) - 1 / rate_hz) < 0.01 / rate_hz


def test_over_a_cable_it_is_there_at_once_and_the_lamp_does_what_the_box_wants() -> None:
    one, sent = course(3, Lane.CABLE, seconds=8)
    assert {packet.lane for packet in sent} == {Lane.CABLE}
    readings = [packet for packet in sent if packet.sample is not None]
    assert readings[0].at < 53.0
    assert one.light == "slow"
    one.switch_off(60.0)
    one.step(60.0)
    assert one.light == "off"
    one.close()


def test_the_emulators_switch_gives_a_new_boot_each_time_and_never_the_same() -> None:
    one = device(reboot_every_s=6.0)
    one.start(50.0)
    one.connect(Lane.NETWORK, True, 50.0)
    nonces: list[int] = []
    for step in range(1, 430):
        nonces += (wire.HEAD.unpack_from(packet.data)[4] for packet in one.step(50.0 + 0.1 * step))
    assert one.reboots == 5
    assert len(set(nonces)) == 6
    assert sorted(nonces, key=nonces.index) == nonces


def test_no_boot_nonce_comes_twice_though_noise_and_clock_begin_alike() -> None:
    """Each power-on in a world with the same seed: only the flash's count of power-ons tells them apart."""
    flash, nonces = provision(KEY), set()
    for _ in range(50):
        wearable = CompiledWearable(flash, seed=3)
        wearable.power(True)
        nonces.add(wearable.status.boot_nonce)
        flash = wearable.flash_image()
        wearable.close()
    assert len(nonces) == 50


def test_the_console_keeps_its_secrets_and_says_what_is_wrong(wearable: CompiledWearable) -> None:
    wearable.power(True)
    wearable.connect_cable(True)
    answers = [ask(wearable, line) for line in ("id", "show", "status", "help")]
    assert all(answer.startswith("ok") for answer in answers)
    assert f"wire {wire.WIRE_HASH:08x}" in answers[0]
    assert not any(KEY.key.hex() in answer or PASSWORD in answer for answer in answers)
    assert "name left-wrist" in answers[1]
    assert ask(wearable, "sing") == "error: unknown command 'sing'; type help"


def test_forgetting_and_a_torn_save_leave_a_wearable_that_can_be_provisioned(
    wearable: CompiledWearable,
) -> None:
    wearable.power(True)
    wearable.connect_cable(True)
    wearable.set_trouble("flash tears", 1)
    assert ask(wearable, "save").startswith("error")
    wearable.power(False)
    again = CompiledWearable(wearable.flash_image(), seed=4)
    again.power(True)
    again.connect_cable(True)
    assert ask(again, "id").startswith("ok bunraku-wearable")
    assert ask(again, "forget").startswith("ok")
    assert ask(again, f"set device {KEY.device_id:08x}") == "ok"
    assert ask(again, f"set key {KEY.key.hex()}") == "ok"
    assert ask(again, "save") == "ok saved"
    again.step_until(again.status.now_us + 100_000)
    assert again.status.state != State.NOT_PROVISIONED
    again.close()


def test_the_clock_wraps_in_the_middle_of_a_dance() -> None:
    wearable = CompiledWearable(provision(KEY), seed=3, first_us=(1 << 32) - 8 * SECOND_US)
    wearable.set_network(NETWORK, PASSWORD)
    wearable.set_access_point(True, 0)
    wearable.power(True)
    box, times = ScriptedBox(), []
    for step in range(1, 1600):
        wearable.step_until(10_000 * step)
        for sent in wearable.take_datagrams():
            if sent.data[3] == wire.READING.kind:
                times.append(int.from_bytes(sent.data[20:24], "little"))
            answer = box.answer(Outgoing(sent.data, Lane.NETWORK, 0.0))
            if answer is not None:
                wearable.put_datagram(BOX, answer)
        if step % 100 == 0:
            wearable.put_datagram(BOX, box.heartbeat())
    wearable.close()
    assert times[0] > 1 << 31 > times[-1]
    steps_us = [(after - before) % (1 << 32) for before, after in pairwise(times)]
    assert min(steps_us) > 19_000
    assert max(steps_us) < 21_000


def test_a_double_tap_is_counted_and_a_dancing_hand_is_none(wearable: CompiledWearable) -> None:
    wearable.power(True)
    for step in range(1, 1000):
        wearable.go_to(motions.about((0, 1, 0), 0.8 * pi * (step % 2)), 500_000 * step // 10)
    wearable.step_until(30 * SECOND_US)
    assert wearable.status.taps == 0
    wearable.stand((1.0, 0.0, 0.0, 0.0))
    wearable.step_until(32 * SECOND_US)
    wearable.double_tap()
    wearable.step_until(34 * SECOND_US)
    assert wearable.status.taps == 1


def test_unknown_trouble_is_refused(wearable: CompiledWearable) -> None:
    with pytest.raises(ValueError, match="no fault 'rain'"):
        wearable.inject("rain")
    with pytest.raises(ValueError, match="no trouble 'rain'"):
        wearable.set_trouble("rain", 1.0)
    with pytest.raises(ValueError, match="no image"):
        CompiledWearable(b"\x01\xff\xff")
    with pytest.raises(ValueError, match="no such IMU"):
        CompiledWearable(imu="bno999")


def test_hellos_go_to_all_each_half_second_until_a_box_answers(wearable: CompiledWearable) -> None:
    wearable.power(True)
    wearable.step_until(10 * SECOND_US)
    hellos = hellos_of(wearable)
    assert 10 <= len(hellos) <= 20
    assert [hello.sequence for hello in hellos] == list(range(1, len(hellos) + 1))
    assert {hello.wire_hash for hello in hellos} == {wire.WIRE_HASH}


@pytest.mark.realtime
def test_as_processes_over_real_sockets(emulate: Emulate, tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    create_keys(path, ["left-wrist", "head"])
    link = open_link(load_keys(path), udp=("127.0.0.1", 0))
    process = emulate("--firmware", "--keys", path, "--port", port_of(link), "--network", "perfect")
    readings = hear_until(link, lambda heard: {one.sensor for one in heard} == {"left-wrist", "head"})
    process.terminate()
    assert process.wait(timeout=60) == 0
    link.close()
    assert len({reading.boot_nonce for reading in readings}) == 2


@pytest.mark.realtime
def test_as_a_process_over_a_real_tty(emulate: Emulate, tmp_path: Path) -> None:
    path = tmp_path / "sensors.keys"
    create_keys(path, ["head"])
    with NullModem(tmp_path) as cable:
        link = open_link(load_keys(path), serial=[(str(cable.far), 115200)])
        process = emulate("--firmware", "--keys", path, "--serial", cable.near)
        hear_until(link, lambda heard: len(heard) > 25)
        process.terminate()
        assert process.wait(timeout=60) == 0
        link.close()
