"""Sensors that dancers put on, stand still and dance with, heard as the stage hears them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from appliance.pose import quaternion
from appliance.sensor.link import SensorReading
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts

SENSOR = "left-wrist"
HANGING = (0.8, 0.0, 0.0, -0.6)
HAND: dict[str, object] = {"sensor": SENSOR, "joint": "lShldr", "at_neutral": list(HANGING)}
TICK_S = 0.02
BOOT, NEXT_BOOT = 0xB007, 0xB008

Orientation = tuple[float, float, float, float]
Evening = Callable[..., "Stage"]


def about_up(degrees: float) -> Orientation:
    """A reading, sensor axes: z is up."""
    return math.cos(math.radians(degrees) / 2), 0.0, 0.0, math.sin(math.radians(degrees) / 2)


def about_front(degrees: float) -> Orientation:
    return math.cos(math.radians(degrees) / 2), math.sin(math.radians(degrees) / 2), 0.0, 0.0


def multiply(a: Orientation, b: Orientation) -> Orientation:
    w, x, y, z = (float(part) for part in quaternion.multiply(np.array(a), np.array(b)))
    return w, x, y, z


class Stage:
    """What SensorFit joins, without ports: readings come from the test, at 50 Hz of its own time."""

    def __init__(self, parts: StageParts, memory: SensorMemory) -> None:
        self.said: list[str] = []
        self.parts = parts
        self.memory = memory
        self.wearing = SensorFit(parts, memory)
        self.now = 100.0
        self.sequence = 0

    def hear(
        self,
        orientation: Orientation,
        sensor: str = SENSOR,
        boot: int = BOOT,
        taps: int = 0,
        restarts: int = 0,
        wearable: int = 1,
        flags: int = 0,
    ) -> None:
        """One tick with one reading."""
        self.now += TICK_S
        self.sequence += 1
        reading = SensorReading(
            *(sensor, orientation, self.sequence, 0, self.now, self.now, 90, 255),
            *(boot, taps, restarts),
            wearable=wearable,
            flags=flags,
        )
        self.take(reading)

    def take(self, reading: SensorReading) -> None:
        self.wearing.hear(reading)
        self.parts.hear(reading)
        self.parts.led.hands.pull(self.now, self.parts.led.puppet.select(self.parts.led.motion.window()))
        self._look()

    def _look(self) -> None:
        self.wearing.look(self.now)
        self.said += self.wearing.messages

    def stand(self, seconds: float, orientation: Orientation, **reading: int | str) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.hear(orientation, **reading)  # type: ignore[arg-type]

    def dance(self, seconds: float, boot: int = BOOT, **reading: int) -> None:
        """Never still: 150 degrees a second."""
        for step in range(round(seconds / TICK_S)):
            self.hear(multiply(about_up(3.0 * step), about_front(2.0 * step)), boot=boot, **reading)

    def silence(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.now += TICK_S
            self.parts.led.hands.pull(self.now, self.parts.led.puppet.select(self.parts.led.motion.window()))
            self._look()

    def target(self, joint: str = "lShldr") -> np.ndarray:
        return self.parts.led.hands.targets[0, self.parts.led.puppet.joints.index(joint)].copy()

    @property
    def wants(self) -> bool:
        return SENSOR in self.parts.link.wants_neutral

    def taken(self, sensor: str = SENSOR) -> int:
        return self.said.count(f"Sensor {sensor}: neutral pose taken. Dance.")


def holds(target: np.ndarray, expected: Orientation) -> bool:
    return bool(quaternion.angle_between(target, np.array(expected)) < 0.01)
