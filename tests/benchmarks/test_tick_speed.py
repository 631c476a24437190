"""The whole tick: a sensor's datagram in, ten iterations at hop 1, the joints' datagrams out."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey, create_keys
from appliance.sensor.memory import SensorMemory
from appliance.sensor.udp import UdpIntake
from appliance.show.box import BoxConfig, OscConfig, OutputsConfig, SensorsConfig, UdpConfig
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.stage.cast import Cast, Iterations, assemble
from appliance.stage.clock import TICK_S, Slot
from appliance.stage.tick import Tick
from appliance.stage.wearing import Wearing

SENSOR = "left-wrist"


class Sensor:
    """Signs readings of a slow turn and sends them to the box."""

    def __init__(self, key: SensorKey, address: tuple[str, int]) -> None:
        self._key, self._tagger, self._sequence = key, wire.Tagger(key.key), 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)

    def send(self) -> None:
        self._sequence += 1
        half = math.radians(self._sequence % 360) / 2
        turn = (math.cos(half), 0.0, math.sin(half), 0.0)
        moment_us = 20_000 * self._sequence
        reading = wire.Reading(self._key.device_id, 1, 0, self._sequence, moment_us, turn, 0xFF, 80, 0, 0, 0, 0)
        self._socket.send(wire.pack(reading, self._tagger))

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def show(tiny_show: Path) -> Path:
    """The default show where there is one, else a small one."""
    default = default_show_path()
    return default if (default / "puppet.onnx").exists() else tiny_show


@pytest.fixture
def receiver() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        yield listening


@pytest.fixture
def key(tmp_path: Path) -> SensorKey:
    return create_keys(tmp_path / "sensors.keys", [SENSOR])[SENSOR]


@pytest.fixture
def cast(tmp_path: Path, key: SensorKey, show: Path, receiver: socket.socket) -> Iterator[Cast]:
    out = OscConfig(port=receiver.getsockname()[1], dialect="ai-toolbox")
    box = BoxConfig(
        sensors=SensorsConfig(udp=UdpConfig(port=0), keys=tmp_path / "sensors.keys"),
        outputs=OutputsConfig(osc=[out]),
    )
    made = assemble(load_show(show), box)
    yield made
    made.close()


def test_the_whole_tick(measured: Callable[..., Any], cast: Cast, key: SensorKey) -> None:
    intake = cast.link.intakes[0]
    assert isinstance(intake, UdpIntake)
    sensor = Sensor(key, intake.address)
    wearing = Wearing(cast, SensorMemory(None, print), print)
    tick = Tick(cast, wearing, Iterations(10, 9, 10), latest_start_s=TICK_S)
    slot, ran = Slot(), 0

    def next_slot() -> tuple[tuple[Slot], dict[str, object]]:
        nonlocal ran
        ran += 1
        sensor.send()
        slot.tick, slot.deadline = ran, time.monotonic()
        slot.started = slot.deadline
        return (slot,), {}

    label = f"datagram to sendto, {cast.puppet.architecture} {cast.puppet.precision}"
    benchmark = measured(label, "the whole tick, back to back")
    benchmark.pedantic(tick.run, setup=next_slot, rounds=400)
    sensor.close()
    assert cast.link.counts["accepted"] == ran
    assert not tick.frame.late and not tick.network_failed
    assert tick.frame.sensor_sequence == ran
