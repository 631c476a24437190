"""The whole tick: a sensor's datagram in, ten iterations at hop 1, the joints' datagrams out."""

from __future__ import annotations

import shutil
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.box.clock import TICK_S, Slot
from appliance.sensor.keys import SensorKey, create_keys
from appliance.sensor.transports.udp import UdpIntake
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig, UdpConfig
from appliance.show.bundle import default_show_path
from appliance.show.osc import OscConfig
from appliance.show.show import load_show
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from hw_sim.motions import turning
from tests.hw_sim.paired import PairedSensor

SENSOR = "left-wrist"


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


@pytest.fixture(params=[1, 2, 4])
def parts(
    request: pytest.FixtureRequest, tmp_path: Path, key: SensorKey, show: Path, receiver: socket.socket
) -> Iterator[StageParts]:
    """Of a show with one, two or four puppets, each of them led by the sensor."""
    out = OscConfig(port=receiver.getsockname()[1], dialect="ai-toolbox")
    box = BoxConfig(
        sensors=SensorsConfig(udp=UdpConfig(port=0), keys=tmp_path / "sensors.keys"),
        outputs=OutputsConfig(osc=[out]),
    )
    several = shutil.copytree(show, tmp_path / "several")
    puppets = ["", "puppets:", "  - name: first"]
    for number in range(1, request.param):
        hand = f"{{sensor: {SENSOR}, joint: lShldr}}"
        puppets.append(f"  - {{name: puppet {number}, x: {number}, hands: [{hand}]}}")
    with (several / "show.yaml").open("a", encoding="utf-8") as file:
        file.write("\n".join(puppets))
    made = assemble(load_show(several), box)
    yield made
    made.close()


def test_the_whole_tick(measured: Callable[..., Any], parts: StageParts, key: SensorKey) -> None:
    intake = parts.link.intakes[0]
    assert isinstance(intake, UdpIntake)
    sensor = PairedSensor(key, intake.address[1], turning(seconds_per_turn=7.2), 100.0)
    now = sensor.pair(parts.link, 100.0)
    paired = parts.link.counts["accepted"]
    wearing = SensorFit(parts, SensorMemory(None))
    parts.led.iterations = Iterations(10, 9, 10)
    tick = Tick(parts, wearing, latest_start_s=TICK_S)
    for other in parts.puppets[1:]:
        other.iterations = Iterations(10, 9, 10)
    slot, ran = Slot(), 0

    def next_slot() -> tuple[tuple[Slot], dict[str, object]]:
        nonlocal ran
        ran += 1
        slot.tick, slot.deadline = ran, now + ran * TICK_S
        slot.started = slot.deadline
        parts.link.send_due(slot.deadline)
        sensor.advance(slot.deadline)
        return (slot,), {}

    count = len(parts.puppets)
    what = f"{parts.network.architecture} {parts.network.precision}, {count} to dance"
    group = "the whole tick, datagram to sendto, back to back"
    benchmark = measured(what, group, reference=count == 1)
    benchmark.pedantic(tick.run, setup=next_slot, rounds=400)
    sensor.close()
    assert parts.link.counts["accepted"] - paired == ran
    assert not tick.late and not tick.network_failed
    assert tick.frame.sensor_sequence == paired + ran - 1
