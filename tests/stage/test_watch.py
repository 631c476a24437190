"""Each change is said once: what happened, what the audience sees, what to do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.sensor.link import SensorReading, SensorState
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.osc import OscConfig
from appliance.show.show import load_show
from appliance.stage.admission import Admission
from appliance.stage.health import Health
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.watch import Watch
from hw_sim.osc_receiver import OscReceiver
from tests.bundles import write_show

FITS = Admission(3, 2, 3, 2, 64, 0.1, 0.2, 0.3, 10.0)


@pytest.fixture
def receiver() -> Iterator[OscReceiver]:
    with OscReceiver("127.0.0.1") as receiver:
        yield receiver


@pytest.fixture
def cast(tmp_path: Path, receiver: OscReceiver) -> Iterator[StageParts]:
    box = BoxConfig(
        sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[OscConfig(port=receiver.port)])
    )
    cast = assemble(load_show(write_show(tmp_path / "show")), box)
    yield cast
    cast.close()


def hear(cast: StageParts, at: float) -> None:
    cast.hear(SensorReading("left-wrist", (1.0, 0.0, 0.0, 0.0), 1, 0, at, at, 90, 255))


def test_a_silent_sensor_and_its_return(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    assert watch.check(10.0, Health()) == []  # never heard: the introduction and the status line say so
    hear(cast, 11.0)
    assert watch.check(11.1, Health()) == []
    absent = [sensor(state="lost")]
    assert watch.check(11.5 + 0.001, Health(), absent) == [
        "Sensor left-wrist silent for 0.5 s. The dancer moves freely. Check its battery."
    ]
    assert watch.check(12.5, Health(), absent) == []
    hear(cast, 13.0)
    assert watch.check(13.1, Health()) == ["Sensor left-wrist is back. It takes its joint again."]


def test_a_sensor_that_is_heard_and_lost_between_two_looks_is_silent_too(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    assert watch.check(10.0, Health(), [sensor(state="absent", way="")]) == []
    hear(cast, 10.2)
    lost = [sensor(state="lost", way="")]
    assert watch.check(11.0, Health(), lost) == [
        "Sensor left-wrist silent for 0.8 s. The dancer moves freely. Check its battery."
    ]
    assert watch.check(12.0, Health(), lost) == []


def test_a_revoked_sensor_has_no_battery_to_be_checked(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    hear(cast, 11.0)
    assert len(watch.check(11.1, Health(), [sensor()])) == 1
    assert watch.check(12.0, Health()) == []
    assert watch.check(20.0, Health()) == []


def sensor(
    name: str = "left-wrist",
    state: str = "linked",
    way: str = "10.0.0.7:2390",
    battery: int = 90,
    complaint: str = "",
) -> SensorState:
    return SensorState(
        *(name, 1, state, way, 50.0, 0.0, 0.004, 0.01, battery, 255, "1.0.0", "", 0, 7, complaint)
    )


def test_a_sensor_that_is_linked_and_what_it_holds(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    assert watch.check(1.0, Health(), [sensor(state="absent", way="")]) == []
    assert watch.check(2.0, Health(), [sensor(state="greeted", way="")]) == []
    assert watch.check(3.0, Health(), [sensor(), sensor(name="spare", way="10.0.0.8:2390")]) == [
        "Sensor left-wrist is linked by 10.0.0.7:2390, and holds lShldr.",
        "Sensor spare is linked by 10.0.0.8:2390, and holds no joint of this show.",
    ]
    assert watch.check(4.0, Health(), [sensor(), sensor(name="spare", way="10.0.0.8:2390")]) == []


def test_a_sensor_that_moves_to_a_cable_and_back(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    watch.check(1.0, Health(), [sensor()])
    assert watch.check(2.0, Health(), [sensor(way="/dev/ttyACM0")]) == [
        "Sensor left-wrist now speaks by /dev/ttyACM0. The dance goes on."
    ]
    assert watch.check(3.0, Health(), [sensor(state="lost", way="")]) == []  # its silence is told of
    assert watch.check(4.0, Health(), [sensor(way="/dev/ttyACM0")]) == []
    assert len(watch.check(5.0, Health(), [sensor()])) == 1


def test_a_low_battery_is_told_of_once_until_it_was_charged(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    reported = [
        watch.check(1.0, Health(), [sensor(battery=level)]) for level in (16, 14, 15, 13, 255, 12, 80, 9)
    ]
    assert [len(message) for message in reported] == [1, 1, 0, 0, 0, 0, 0, 1]  # the first one: linked
    assert reported[1] == ["Sensor left-wrist: 14 % of its battery left. The dance goes on. Charge it soon."]


def test_a_complaint_of_the_link_is_passed_on_once(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    stranger = sensor(state="greeted", way="", complaint="Sensor left-wrist speaks another wire.")
    assert watch.check(1.0, Health(), [stranger]) == ["Sensor left-wrist speaks another wire."]
    assert watch.check(2.0, Health(), [stranger]) == []


def test_a_receiver_that_goes_and_comes_back(cast: StageParts, receiver: OscReceiver) -> None:
    watch = Watch(cast, FITS)
    counters = cast.outputs.receivers[0]
    assert watch.check(1.0, Health()) == []
    counters.dropped += 3
    counters.last_error = "no program listens on that port"
    [message] = watch.check(2.0, Health())
    assert f"127.0.0.1:{receiver.port}" in message
    assert "no program listens on that port" in message
    counters.dropped += 3
    assert watch.check(3.0, Health()) == []
    [message] = watch.check(4.0, Health())
    assert "gets the dance again" in message


def test_a_network_that_fails_and_recovers(cast: StageParts) -> None:
    watch = Watch(cast, FITS)
    cast.led.puppet.is_broken = True
    [message] = watch.check(1.0, Health())
    assert "holds the last good pose" in message
    assert watch.check(2.0, Health()) == []
    cast.led.puppet.is_broken = False
    [message] = watch.check(3.0, Health())
    assert "gives poses again" in message


def danced(costs_ms: list[float]) -> Health:
    health = Health()
    health.begin(100.0)
    for cost_ms in costs_ms:
        health.tick(cost_ms, budget_ms=10.0)
    return health


def test_a_good_second() -> None:
    health = danced([1.5] * 49 + [3.0])
    assert not health.is_due(100.98)
    assert health.is_due(101.0)
    health.look(101.0)
    line = health.line(10, 9, 0.012, locked=True)
    assert " ".join(line.split()) == (
        "50.0 Hz tick 1.5/1.5 ms (p50/p99) late 0 sensor 12 ms ago, in phase iterations 10/9"
    )


def test_trouble_is_named_and_counted() -> None:
    health = danced([1.0] * 40 + [12.0] * 2)
    health.late, health.skipped, health.not_finite = 3, 2, 1
    health.look(101.0)
    line = health.line(10, 9, 0.5, locked=False)
    assert "42.0 Hz" in line
    assert "late 3" in line
    assert "skipped 2" in line
    assert "over budget 2" in line
    assert "network not finite 1" in line
    assert "in phase" not in line
    assert health.worst_ms == 12.0


def test_each_line_covers_its_own_second() -> None:
    health = danced([9.0] * 50)
    health.look(101.0)
    for _ in range(25):
        health.tick(1.0, budget_ms=10.0)
    health.look(102.0)
    line = health.line(10, 9, None, locked=False)
    assert "25.0 Hz" in line
    assert "1.0/1.0 ms" in line
    assert "no sensor" in line


def test_a_sensor_that_was_never_heard() -> None:
    health = danced([1.0])
    health.look(101.0)
    assert "not heard yet" in health.line(10, 9, float("inf"), locked=False)


def test_a_second_without_ticks_has_a_line_too() -> None:
    health = danced([])
    health.look(101.0)
    assert "0.0 Hz" in health.line(10, 9, None, locked=False)


def test_the_snapshot_has_the_last_second_and_the_counters_of_the_run() -> None:
    health = danced([2.0] * 50)
    health.late = 3
    health.look(101.0)
    for _ in range(10):
        health.tick(12.0, budget_ms=10.0)
    assert health.snapshot(101.25) == {
        "rate_hz": 50.0,
        "late": 3,
        "skipped": 0,
        "over_budget": 10,
        "not_finite": 0,
        "ticks": 60,
        "tick_p50_ms": 2.0,
        "tick_p99_ms": 2.0,
        "uptime_s": 1.25,
    }
