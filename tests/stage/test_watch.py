"""Each change is said once: what happened, what the audience sees, what to do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.sensor.link import SensorReading, SensorState
from appliance.show.box import BoxConfig, OscConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.watch import Watch
from hw_sim.osc_receiver import OscReceiver
from tests.bundles import write_show


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
    watch = Watch(cast)
    assert list(watch.news(10.0)) == []  # never heard: the introduction and the status line say so
    hear(cast, 11.0)
    assert list(watch.news(11.1)) == []
    absent = [sensor(state="lost")]
    assert list(watch.news(11.5 + 0.001, absent)) == [
        "Sensor left-wrist silent for 0.5 s. The dancer moves freely. Check its battery."
    ]
    assert list(watch.news(12.5, absent)) == []
    hear(cast, 13.0)
    assert list(watch.news(13.1)) == ["Sensor left-wrist is back. It takes its joint again."]


def test_a_sensor_that_is_heard_and_lost_between_two_looks_is_silent_too(cast: StageParts) -> None:
    watch = Watch(cast)
    assert list(watch.news(10.0, [sensor(state="absent", way="")])) == []
    hear(cast, 10.2)
    lost = [sensor(state="lost", way="")]
    assert list(watch.news(11.0, lost)) == [
        "Sensor left-wrist silent for 0.8 s. The dancer moves freely. Check its battery."
    ]
    assert list(watch.news(12.0, lost)) == []


def test_a_revoked_sensor_has_no_battery_to_be_checked(cast: StageParts) -> None:
    watch = Watch(cast)
    hear(cast, 11.0)
    assert len(list(watch.news(11.1, [sensor()]))) == 1
    assert list(watch.news(12.0)) == []
    assert list(watch.news(20.0)) == []


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
    watch = Watch(cast)
    assert list(watch.news(1.0, [sensor(state="absent", way="")])) == []
    assert list(watch.news(2.0, [sensor(state="greeted", way="")])) == []
    assert list(watch.news(3.0, [sensor(), sensor(name="spare", way="10.0.0.8:2390")])) == [
        "Sensor left-wrist is linked by 10.0.0.7:2390, and holds lShldr.",
        "Sensor spare is linked by 10.0.0.8:2390, and holds no joint of this show.",
    ]
    assert list(watch.news(4.0, [sensor(), sensor(name="spare", way="10.0.0.8:2390")])) == []


def test_a_sensor_that_moves_to_a_cable_and_back(cast: StageParts) -> None:
    watch = Watch(cast)
    list(watch.news(1.0, [sensor()]))
    assert list(watch.news(2.0, [sensor(way="/dev/ttyACM0")])) == [
        "Sensor left-wrist now speaks by /dev/ttyACM0. The dance goes on."
    ]
    assert list(watch.news(3.0, [sensor(state="lost", way="")])) == []  # its silence is told of
    assert list(watch.news(4.0, [sensor(way="/dev/ttyACM0")])) == []
    assert len(list(watch.news(5.0, [sensor()]))) == 1


def test_a_low_battery_is_told_of_once_until_it_was_charged(cast: StageParts) -> None:
    watch = Watch(cast)
    told = [list(watch.news(1.0, [sensor(battery=level)])) for level in (16, 14, 15, 13, 255, 12, 80, 9)]
    assert [len(words) for words in told] == [1, 1, 0, 0, 0, 0, 0, 1]  # the first one: linked
    assert told[1] == ["Sensor left-wrist: 14 % of its battery left. The dance goes on. Charge it soon."]


def test_a_complaint_of_the_link_is_passed_on_once(cast: StageParts) -> None:
    watch = Watch(cast)
    stranger = sensor(state="greeted", way="", complaint="Sensor left-wrist speaks another wire.")
    assert list(watch.news(1.0, [stranger])) == ["Sensor left-wrist speaks another wire."]
    assert list(watch.news(2.0, [stranger])) == []


def test_a_receiver_that_goes_and_comes_back(cast: StageParts, receiver: OscReceiver) -> None:
    watch = Watch(cast)
    counters = cast.outputs.receivers[0]
    assert list(watch.news(1.0)) == []
    counters.dropped += 3
    counters.last_error = "nobody listens on that port"
    [words] = watch.news(2.0)
    assert f"127.0.0.1:{receiver.port}" in words
    assert "nobody listens on that port" in words
    counters.dropped += 3
    assert list(watch.news(3.0)) == []
    [words] = watch.news(4.0)
    assert "gets the dance again" in words


def test_a_network_that_fails_and_recovers(cast: StageParts) -> None:
    watch = Watch(cast)
    cast.puppet.is_broken = True
    [words] = watch.news(1.0)
    assert "holds the last good pose" in words
    assert list(watch.news(2.0)) == []
    cast.puppet.is_broken = False
    [words] = watch.news(3.0)
    assert "gives poses again" in words
