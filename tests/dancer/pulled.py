"""Puppeteers that are pulled tick by tick, and what they show."""

from __future__ import annotations

import numpy as np

from appliance.dancer.puppeteers import Remote, WornSensor
from appliance.pose import quaternion

TICK_S = 0.02
LEFT = tuple(quaternion.from_axis_angle([0, 1, 0], 0.5).tolist())
RIGHT = tuple(quaternion.from_axis_angle([0, 1, 0], -0.7).tolist())


def weights(puppeteer: WornSensor | Remote, start_s: float, end_s: float) -> np.ndarray:
    """Its weight at each tick of a time."""
    ticks = np.arange(round(start_s / TICK_S), round(end_s / TICK_S))
    return np.array([puppeteer.pull(tick * TICK_S).weight for tick in ticks])


def worn(until_s: float, orientation: tuple[float, ...] = LEFT) -> WornSensor:
    """A sensor that was heard at every tick up to a time."""
    sensor = WornSensor("lShldr")
    sensor.pull(0.0)
    for tick in range(1, round(until_s / TICK_S) + 1):
        sensor.take_reading(orientation, tick * TICK_S)
        sensor.pull(tick * TICK_S)
    return sensor
