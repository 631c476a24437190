"""A tick waits for the reading of its hand that is late, over a real socket, and never for long."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.box.clock import Slot
from appliance.recorder.record import facts_of_run, layout_of
from appliance.sensor.link import SensorLink, open_link
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage.iterations import Iterations
from appliance.stage.rerun import Rerun
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from tests.bundles import write_show
from tests.sensor.peers import KEYS
from tests.sensor.radio import Radio, intake_of

PATIENT_S = 30.0  # longer than any machine holds up the sender


@pytest.fixture
def link() -> Iterator[SensorLink]:
    with closing(open_link(KEYS, udp=("127.0.0.1", 0))) as link:
        yield link


@pytest.fixture
def radio(link: SensorLink) -> Iterator[Radio]:
    radio = Radio(intake_of(link).address)
    radio.pair(link)
    with closing(radio.socket):
        yield radio


@pytest.fixture
def parts(tmp_path: Path, link: SensorLink) -> Iterator[StageParts]:
    no_ports = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
    with closing(assemble(load_show(write_show(tmp_path / "show")), no_ports)) as parts:
        parts.link = link
        yield parts


def made(parts: StageParts, late_look_s: float) -> Tick:
    fit = SensorFit(parts, SensorMemory(None))
    parts.led.iterations = Iterations(3, 2, 10)
    return Tick(parts, fit, latest_start_s=PATIENT_S, late_look_s=late_look_s)


def run(tick: Tick, number: int) -> None:
    now = time.monotonic()
    tick.run(Slot(number, now, now))
    tick.after(Slot(number, now, now))


def test_the_frame_carries_the_late_reading(parts: StageParts, radio: Radio) -> None:
    tick = made(parts, PATIENT_S)
    radio.socket.send(radio.wearable.reading())
    run(tick, 1)
    late = radio.wearable.reading()
    thread = threading.Timer(0.005, radio.socket.send, [late])
    thread.start()
    run(tick, 2)
    thread.join()
    assert [one.sequence for one in tick.readings] == [radio.wearable.sequence]
    assert tick.frame.sensor_sequence == radio.wearable.sequence
    assert tick.waited_s > 0.0


def test_the_wait_is_no_cost_of_the_tick(parts: StageParts, radio: Radio) -> None:
    tick = made(parts, 0.2)
    radio.socket.send(radio.wearable.reading())
    run(tick, 1)
    now = time.monotonic()
    tick.run(Slot(2, now, now))
    assert tick.waited_s >= 0.19
    took_s = time.monotonic() - now
    assert tick.after(Slot(2, now, now)) <= 1000.0 * (took_s - tick.waited_s) + 1.0
    assert tick.frame.sensor_sequence == radio.wearable.sequence  # still the one before


def test_a_sensor_that_fell_silent_is_not_waited_for(parts: StageParts, radio: Radio) -> None:
    tick = made(parts, PATIENT_S)
    radio.socket.send(radio.wearable.reading())
    run(tick, 1)
    then = time.monotonic() + 1.0  # an invented time, after a silence
    tick.run(Slot(50, then, then))
    assert tick.waited_s == 0.0


def test_no_tick_waits_until_its_frame_is_late(parts: StageParts, radio: Radio) -> None:
    tick = made(parts, PATIENT_S)
    radio.socket.send(radio.wearable.reading())
    run(tick, 1)
    tick.late_s = 0.05
    now = time.monotonic()
    tick.run(Slot(2, now, now))
    assert 0.0 < tick.waited_s < PATIENT_S


def test_packets_of_others_do_not_end_the_wait(parts: StageParts, link: SensorLink, radio: Radio) -> None:
    tick = made(parts, PATIENT_S)
    radio.socket.send(radio.wearable.reading())
    run(tick, 1)
    old = radio.wearable.reading()
    radio.socket.send(old)
    run(tick, 2)
    radio.socket.send(old)  # a duplicate comes first
    newest = radio.wearable.reading()
    thread = threading.Timer(0.005, radio.socket.send, [newest])
    thread.start()
    run(tick, 3)
    thread.join()
    assert tick.frame.sensor_sequence == radio.wearable.sequence
    assert link.counts["duplicate"] == 1


def test_a_box_that_follows_hears_the_others_where_the_leader_waited_in_vain(tmp_path: Path) -> None:
    """It asked the sockets again, which it does not hear, and lost the readings of all other sensors."""
    hands: list[dict[str, object]] = [
        {"sensor": "left-wrist", "joint": "lShldr"},
        {"sensor": "head", "joint": "Chest"},
    ]
    show = load_show(write_show(tmp_path / "two", hands))
    no_ports = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
    with closing(assemble(show, no_ports)) as parts:
        tick, sensors = made(parts, 0.01), list(parts.worn)
        rerun = Rerun(tick, tick.wearing, sensors)
        parts.link = rerun.heard
        recorded = np.zeros(1, layout_of(facts_of_run(show, sensors)))[0]
        recorded["reading_orientation"][:, 0], recorded["iterations"] = 1.0, (1, 0)
        for number, here in ((1, [1, 1]), (2, [0, 1])):
            recorded["tick"], recorded["reading_here"] = number, here
            recorded["frame_time"] = recorded["started"] = recorded["reading_times"][:, 1] = 100 + number / 50
            rerun.dance(recorded)
        assert [one.sensor for one in tick.readings] == ["head"]
