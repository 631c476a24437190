"""From the switch to the dance: emulated wearables and the compiled firmware on the box's own link."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorReading
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import assemble
from hw_sim.device import Device
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.firmware import FirmwareSensor, firmware_maker
from hw_sim.motions import IDENTITY, Motion, Quaternion, about, dance, multiply
from hw_sim.network import PERFECT, VenueNetwork
from hw_sim.wearer import Wearer
from tests.bundles import write_show
from tests.hw_sim.joined import TICK_S, Show

KEY = SensorKey("left-wrist", 0x1A2B3C4D, bytes(range(16)))
HANGING: Quaternion = (0.766, 0.0, 0.0, -0.643)
STANDS_S, DANCES_S = 2.0, 6.5
MAKERS = ("emulated", "firmware")
NEAR_DEGREES = 2.0  # a reading is turned on by up to 10 ms of the arm's motion

Begin = Callable[..., "Evening"]


def evening_of_a_dancer(t_s: float) -> Quaternion:
    """Switched on while it points elsewhere, put on, stood still, danced."""
    if t_s < STANDS_S:
        return about((0.0, 1.0, 0.0), math.radians(130.0) * min(1.0, STANDS_S - t_s))
    if t_s < DANCES_S:
        return IDENTITY
    return about((1.0, 0.3, 0.2), 1.2 * math.sin(1.5 * (t_s - DANCES_S)))


class Evening:
    """One wearable, the link and how it is worn, ticking on an invented clock."""

    def __init__(self, device: Device, folder: Path) -> None:
        self.device = device
        self.memory = SensorMemory(None)
        self.show = Show([device], VenueNetwork(PERFECT, 1), {KEY.name: KEY})
        hand = {"sensor": KEY.name, "joint": "lShldr", "at_neutral": list(HANGING)}
        self._bundle = load_show(write_show(folder / "show", [hand]))
        self.newest: SensorReading | None = None
        self.errors: list[float] = []  # between the joint and the dancer's arm, degrees
        self.lights: list[str] = []
        self.box_on()

    def box_on(self) -> None:
        """The stage around the link that the show has now; it remembers what was kept."""
        box = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
        self.parts = assemble(self._bundle, box)
        self.parts.link = self.show.link
        self.said: list[str] = []
        self.wearing = SensorFit(self.parts, self.memory)

    def restart_box(self) -> None:
        self.close()
        self.show.restart_box()
        self.box_on()

    def run(self, seconds: float) -> None:
        place = self.parts.led.puppet.joints.index("lShldr")
        for _ in range(round(seconds / TICK_S)):
            for reading in self.show.run(TICK_S):
                self.wearing.hear(reading)
                self.parts.hear(reading)
                self.newest = reading
            led = self.parts.led
            led.hands.pull(self.show.now, led.puppet.select(led.motion.window()))
            self.wearing.look(self.show.now)
            self.said += self.wearing.messages
            if self.newest is not None:
                self.errors.append(self._error(self.newest, self.parts.led.hands.targets[0, place]))
            if self.lights[-1:] != [self.device.light]:
                self.lights.append(self.device.light)

    def _error(self, reading: SensorReading, target: np.ndarray) -> float:
        sample = self.show.sent[reading.sensor, reading.boot_nonce, reading.sequence].sample
        true = np.array(multiply(sample.orientation, HANGING))
        return float(np.degrees(quaternion.angle_between(target, true / np.linalg.norm(true))))

    def close(self) -> None:
        self.parts.close()


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    evenings: list[Evening] = []

    def begun(
        maker: str,
        motion: Motion = evening_of_a_dancer,
        reboot_every_s: float | None = None,
        **stands: Any,
    ) -> Evening:
        wearer = Wearer(motion, **stands)
        device: Device
        if maker == "firmware":
            make = firmware_maker(seed=5)
            device = make(KEY, wearer, phase_s=0.0, drift_ppm=20.0, reboot_every_s=reboot_every_s)
        else:
            device = EmulatedSensor(KEY, wearer, reboot_every_s=reboot_every_s)
        evenings.append(Evening(device, tmp_path))
        return evenings[-1]

    yield begun
    for evening in evenings:
        evening.close()
        evening.device.close()


@pytest.mark.parametrize("maker", MAKERS)
def test_switched_on_stood_still_danced(begin: Begin, maker: str) -> None:
    evening = begin(maker)
    evening.run(DANCES_S)
    assert evening.lights[-2:] == ["slow", "on"] and evening.lights.count("slow") == 1
    assert sum("neutral pose taken" in message for message in evening.said) == 1
    evening.errors.clear()
    evening.run(10.0)
    assert max(evening.errors) < NEAR_DEGREES
    assert evening.device.light == "on"


def test_after_a_double_tap_half_a_second_of_stillness_is_enough(begin: Begin) -> None:
    evening = begin("emulated", motion=dance(3), stand_still_s=0.8, taps=True)
    while not evening.show.sent:
        evening.run(TICK_S)
    evening.run(0.8)
    assert sum("neutral pose taken" in message for message in evening.said) == 1
    evening.run(3.0)
    assert max(evening.errors[-50:]) < NEAR_DEGREES


@pytest.mark.parametrize("maker", MAKERS)
def test_a_restart_of_the_box_in_mid_dance_keeps_the_pose(begin: Begin, maker: str) -> None:
    evening = begin(maker)
    evening.run(DANCES_S + 2.0)
    evening.restart_box()
    evening.lights.clear()
    evening.run(1.5)
    evening.errors.clear()
    evening.run(5.0)
    assert max(evening.errors) < NEAR_DEGREES
    assert evening.said == ["Sensor left-wrist: the neutral pose taken before is used on. Dance."]
    assert "slow" not in evening.lights


def test_an_imu_that_starts_anew_in_mid_dance_goes_on_where_it_was(begin: Begin) -> None:
    evening = begin("firmware")
    assert isinstance(evening.device, FirmwareSensor)
    evening.run(DANCES_S + 1.6)
    evening.device.wearable.inject("brown-out")
    evening.run(3.0)
    assert any("IMU restarted" in message for message in evening.said)
    evening.errors.clear()
    evening.run(5.0)
    # What the arm turned while the IMU was away cannot be known: less than a second of this dance.
    assert max(evening.errors) < 45.0
    assert sum("neutral pose taken" in message for message in evening.said) == 1


def test_a_double_tap_takes_out_what_was_left_over(begin: Begin) -> None:
    def stands_again(t_s: float) -> Quaternion:
        return evening_of_a_dancer(t_s) if t_s < DANCES_S + 4.0 else IDENTITY

    evening = begin("firmware", stands_again)
    assert isinstance(evening.device, FirmwareSensor)
    evening.run(DANCES_S + 1.6)
    evening.device.wearable.inject("brown-out")
    evening.run(5.0)
    before = len(evening.lights)
    evening.device.wearable.double_tap()
    evening.run(6.0)  # until its lamp has flashed as all is well again
    assert "slow" in evening.lights[before:] and evening.device.light == "on"
    assert sum("neutral pose taken" in message for message in evening.said) == 2
    assert evening.errors[-1] < 1.0


def test_switched_off_and_on_within_a_minute_the_joint_goes_on(begin: Begin) -> None:
    evening = begin("firmware", reboot_every_s=12.0)
    evening.run(12.5)
    evening.run(10.0)
    assert evening.device.reboots == 1
    assert any("is on again" in message for message in evening.said)
    assert sum("neutral pose taken" in message for message in evening.said) == 1
