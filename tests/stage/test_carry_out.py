"""Orders are carried out between two ticks: jumps, joints held by OSC, and what is asked of sensors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from appliance.box.orders import Order
from appliance.pose import quaternion
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, SensorReading, SensorState
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage.carry_out import obey, obey_for_sensors
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import write_show

BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))


@pytest.fixture
def parts(tmp_path: Path) -> Iterator[StageParts]:
    show = load_show(write_show(tmp_path / "show", [{"osc": True, "joint": "lShldr"}]))
    parts = assemble(show, BOX)
    yield parts
    parts.close()


def test_playback_jumps_and_plays_excerpts(parts: StageParts) -> None:
    assert obey(Order("jump", (1.5,)), parts) == (True, "")
    parts.led.motion.advance()
    assert parts.led.motion.jumped
    done, message = obey(Order("excerpt", (2.0, 2.04)), parts)
    assert not done and "from 2 s to 2.04 s" in message


def test_a_joint_is_held_and_released_by_osc(parts: StageParts) -> None:
    assert obey(Order("hold", (1.0, 0.0, 0.0, np.pi / 2), "lShldr"), parts) == (True, "")
    for tick in range(100):
        parts.led.hands.pull(10.0 + 0.02 * tick, parts.led.puppet.select(parts.led.motion.window()))
    place = parts.led.hand_places[0]
    turned = np.array([0.5**0.5, 0.5**0.5, 0, 0])
    assert quaternion.angle_between(parts.led.hands.targets[0, place], turned) < 1e-3
    assert parts.led.hands.weights[place] == 1.0
    assert obey(Order("release", (), "lShldr"), parts) == (True, "")
    for tick in range(100):
        parts.led.hands.pull(12.0 + 0.02 * tick, parts.led.puppet.select(parts.led.motion.window()))
    assert parts.led.hands.weights[place] == 0.0


def test_a_joint_that_no_hand_holds_by_osc_is_refused_in_words(parts: StageParts) -> None:
    for order, message in [
        (Order("hold", (1.0, 0.0, 0.0, 1.0), "Chest"), "No hand of this show holds 'Chest'"),
        (Order("release", (), "99"), "No hand of this show holds '99'"),
        (Order("hold", (0.0, 0.0, 0.0, 1.0), "lShldr"), "no rotation"),
        (Order("dance"), "knows no order 'dance'"),
    ]:
        done, said = obey(order, parts)
        assert not done and message in said


class HeardLink(SensorLink):
    """A link on which some sensors are heard; what it is asked for is noted."""

    def __init__(self, heard: Mapping[str, str]) -> None:
        super().__init__({}, [])
        self.heard = heard
        self.strobed: list[str] = []
        self.admitted: Mapping[str, SensorKey] = {}

    def states(self, now: float) -> list[SensorState]:
        return [
            SensorState(name, 1, state, "", 0.0, 0.0, None, None, 255, 0, "", "", 0, 0, "")
            for name, state in self.heard.items()
        ]

    def strobe(self, sensor: str, now: float, seconds: float = 10.0) -> None:
        self.strobed.append(sensor)

    def set_keys(self, keys: Mapping[str, SensorKey]) -> None:
        self.admitted = keys


@pytest.fixture
def worn(tmp_path: Path) -> Iterator[StageParts]:
    """left-wrist is worn and heard, head is worn and lost, spare-1 is heard."""
    hands: list[dict[str, object]] = [
        {"sensor": "left-wrist", "joint": "lShldr"},
        {"sensor": "head", "joint": "Chest"},
    ]
    show = load_show(write_show(tmp_path / "worn", hands))
    parts = assemble(show, BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[])))
    parts.link.close()
    parts.link = HeardLink({"left-wrist": "linked", "head": "lost", "spare-1": "greeted"})
    yield parts
    parts.close()


@pytest.mark.parametrize(
    ("order", "done", "message"),
    [
        (Order("strobe", text="left-wrist"), True, "left-wrist flashes for 10 s"),
        (Order("strobe", text="spare-1"), True, "spare-1 flashes"),
        (Order("strobe", text="head"), False, "Sensor head is silent"),
        (Order("strobe", text="left-wirst"), False, "Did you mean 'left-wrist'?"),
        (Order("neutral"), True, "stand still now"),
        (Order("neutral", text="left-wrist"), True, "stand still now"),
        (Order("neutral", text="head"), False, "Sensor head is silent"),
        (Order("neutral", text="spare-1"), False, "No hand of this show is held by a sensor 'spare-1'"),
        (Order("heading"), True, "is the front"),
        (Order("heading", text="nobody"), False, "No hand of this show"),
        (
            Order("reload", keys={"left-wrist": (1, bytes(16))}),
            True,
            "The box knows 1 sensor now, but not head of this show",
        ),
    ],
)
def test_commands_about_sensors_are_done_or_refused_in_words(
    worn: StageParts, order: Order, done: bool, message: str
) -> None:
    assert isinstance(worn.link, HeardLink)
    wearing = SensorFit(worn, SensorMemory(None))
    wearing.hear(SensorReading("left-wrist", (1.0, 0.0, 0.0, 0.0), 1, 0, 99.6, 99.6, 90, 255))
    outcome = obey_for_sensors(order, worn, wearing, 100.0)
    assert outcome[0] == done
    assert message in outcome[1]
    assert worn.link.strobed == ([order.text] if order.name == "strobe" and done else [])
    assert {name: (one.device_id, one.key) for name, one in worn.link.admitted.items()} == order.keys


def test_a_phone_that_needs_no_key_is_not_said_to_miss_one(worn: StageParts) -> None:
    worn.link = SensorLink({}, [], foreign={"head": SensorKey("head", 2, bytes(16), "phone")})
    wearing = SensorFit(worn, SensorMemory(None))
    order = Order("reload", keys={"left-wrist": (1, bytes(16))})
    assert obey_for_sensors(order, worn, wearing, 100.0) == (True, "The box knows 1 sensor now.")


@pytest.mark.parametrize("name", ["neutral", "heading"])
@pytest.mark.parametrize("sensor", ["left-wrist", ""])
def test_whoever_asks_a_sensor_that_is_linked_and_not_heard_now_is_told_that_nothing_is_done(
    worn: StageParts, name: str, sensor: str
) -> None:
    wearing = SensorFit(worn, SensorMemory(None))
    wearing.hear(SensorReading("left-wrist", (1.0, 0.0, 0.0, 0.0), 1, 0, 99.4, 99.4, 90, 255))
    done, message = obey_for_sensors(Order(name, text=sensor), worn, wearing, 100.0)
    assert not done
    assert message.startswith("Not heard at this moment: left-wrist") and "Nothing is changed." in message


def test_a_show_without_sensors_has_no_neutral_pose(parts: StageParts) -> None:
    wearing = SensorFit(parts, SensorMemory(None))
    assert obey_for_sensors(Order("neutral"), parts, wearing, 100.0) == (
        False,
        "No hand of this show is held by a sensor.",
    )
