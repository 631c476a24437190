"""A worn sensor's heading drifts: the box takes it out, where it may."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.pose import quaternion
from appliance.sensor.wire import IS_NDOF
from appliance.stage.sensor_memory import SensorMemory
from tests.stage.worn import HAND, HANGING, SENSOR, TICK_S, Evening, Stage, about_up

A_MINUTE = 3.0  # degrees


def lie(stage: Stage, seconds: float, flags: int = 0) -> float:
    """A sensor that lies and drifts; degrees by which its joint is turned from its neutral pose."""
    for _ in range(round(seconds / TICK_S)):
        stage.hear(about_up(A_MINUTE * (stage.now - 100.0) / 60.0), flags=flags)
    return float(np.degrees(quaternion.angle_between(stage.target(), np.array(HANGING))))


def test_drift_is_taken_out_and_told_and_remembered(evening: Evening, memory: SensorMemory) -> None:
    stage = evening()
    assert lie(stage, 240.0) < 4.0
    assert stage.wearing.corrected_of(SENSOR) > 8.0
    saved = memory.neutral(SENSOR, "lShldr")
    assert saved is not None and np.degrees(saved.heading) > 7.0
    assert stage.wearing.reset_heading(None, stage.now)
    assert stage.wearing.corrected_of(SENSOR) == 0.0


@pytest.mark.parametrize("how", ["switched off", "magnetometer"])
def test_switched_off_or_kept_by_a_magnetometer_nothing_is_corrected(evening: Evening, how: str) -> None:
    stage = evening()
    stage.wearing.corrects_heading = how != "switched off"
    off = lie(stage, 240.0, IS_NDOF if how == "magnetometer" else 0)
    assert off == pytest.approx(A_MINUTE * 4.0, abs=0.5)
    assert stage.wearing.corrected_of(SENSOR) == 0.0


def test_every_joint_of_the_sensor_is_corrected_alike(evening: Evening) -> None:
    stage = evening([HAND, {"sensor": SENSOR, "joint": "Chest"}])
    lie(stage, 240.0)
    chest = quaternion.angle_between(stage.target("Chest"), quaternion.IDENTITY)
    assert np.degrees(chest) < 4.0


def test_a_snapshot_goes_on_to_the_last_bit(evening: Evening) -> None:
    stage, again = evening(), evening()
    lie(stage, 100.3)
    again.wearing.corrects_heading = False  # the snapshot says that it does
    restore(again.wearing, packed(stage.wearing))
    restore(again.parts.led.hands, packed(stage.parts.led.hands))
    again.now, again.sequence = stage.now, stage.sequence
    for one in (stage, again):
        lie(one, 60.0)
    assert stage.wearing.corrected_of(SENSOR) > 2.0
    assert packed(stage.wearing) == packed(again.wearing)
    np.testing.assert_array_equal(stage.target(), again.target())
