"""What becomes of the neutral pose when the box or the sensor starts again, or another sensor replaces it."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.sensor.keys import SensorKey
from tests.sensor.peers import Box, Wearable
from tests.stage.worn import (
    BOOT,
    HANGING,
    NEXT_BOOT,
    SENSOR,
    TICK_S,
    Evening,
    about_front,
    about_up,
    holds,
    multiply,
)


def test_a_restart_of_the_box_keeps_the_pose_of_the_same_power_on(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    again = evening()
    again.stand(0.1, about_up(40.0))
    assert holds(again.target(), HANGING)
    assert not again.wants and again.taken() == 0
    assert again.said == [f"Sensor {SENSOR}: the neutral pose taken before is used on. Dance."]
    assert again.wearing.neutral_of(SENSOR) == "taken"


def test_another_night_begins_with_the_kept_pose_and_wants_a_new_one(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    tomorrow = evening()
    assert tomorrow.wearing.neutral_of(SENSOR) == "kept"
    tomorrow.stand(0.1, about_up(40.0), boot=NEXT_BOOT)
    assert tomorrow.wants and holds(tomorrow.target(), HANGING)
    tomorrow.stand(2.5, about_up(-20.0), boot=NEXT_BOOT)
    assert tomorrow.taken() == 1 and holds(tomorrow.target(), HANGING)


@pytest.mark.parametrize(("boot", "restarts"), [(NEXT_BOOT, 0), (BOOT, 1)])
def test_a_heading_lost_in_mid_show_is_carried_over(evening: Evening, boot: int, restarts: int) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(2.0)
    stage.stand(0.2, multiply(about_up(60.0), about_front(30.0)))
    before = stage.target()
    stage.silence(1.4)
    north_moved = multiply(about_up(-100.0), multiply(about_up(60.0), about_front(30.0)))
    shown = []
    for _ in range(40):
        stage.hear(north_moved, boot=boot, restarts=restarts)
        shown.append(stage.target())
    assert quaternion.angle_between(np.array(shown), before).max() < 0.01
    assert not stage.wants and stage.taken() == 1
    assert "its joint goes on where it was" in stage.said[-1]
    assert ("IMU" in stage.said[-1]) == (boot == BOOT)
    stage.stand(0.5, multiply(about_up(-100.0), about_up(40.0)), boot=boot, restarts=restarts)
    assert holds(stage.target(), HANGING)


def test_what_was_carried_over_survives_a_restart_of_the_box(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.silence(2.0)
    stage.stand(0.5, about_up(-60.0), boot=NEXT_BOOT)
    again = evening()
    again.stand(0.1, about_up(-60.0), boot=NEXT_BOOT)
    assert not again.wants and holds(again.target(), HANGING)


def test_after_more_than_a_minute_the_dancer_stands_still_again(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.silence(61.0)
    stage.stand(0.1, about_up(90.0), boot=NEXT_BOOT)
    assert stage.wants
    stage.stand(2.5, about_up(90.0), boot=NEXT_BOOT)
    assert stage.taken() == 2 and holds(stage.target(), HANGING)


@pytest.mark.parametrize("was_on", [True, False])
def test_a_spare_that_takes_over_the_name_is_another_wearable(evening: Evening, was_on: bool) -> None:
    """It hangs otherwise than the broken one: nothing of that one's pose is its own."""
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.silence(2.0)
    hung_otherwise = multiply(about_up(40.0), about_front(80.0))
    spare = {"wearable": 2, "boot": BOOT if was_on else NEXT_BOOT}
    stage.stand(0.1, hung_otherwise, **spare)
    assert stage.wants and stage.wearing.neutral_of(SENSOR) == "wanted"
    assert stage.said[-1] == f"Sensor {SENSOR} is on. Its dancer stands still for a breath now."
    stage.stand(2.5, hung_otherwise, **spare)
    assert stage.taken() == 2 and holds(stage.target(), HANGING)


@pytest.mark.parametrize("has_same_device_id", [True, False])
def test_a_replaced_sensor_asks_for_stillness_on_the_boxs_own_link(
    evening: Evening, has_same_device_id: bool
) -> None:
    """By its real packets: a spare under the broken one's name, or a new one provisioned in its place."""
    stage, box = evening(), Box()
    key = box.link_keys[SENSOR]

    def stand(wearable: Wearable, degrees: float) -> None:
        for _ in range(150):
            box.now = stage.now = box.now + TICK_S
            for reading in box.hear(wearable.reading(degrees)):
                stage.take(reading)

    stand(box.pair(), 0.0)
    assert stage.taken() == 1
    device_id = key.device_id if has_same_device_id else 0x5BA2E
    spare = SensorKey(SENSOR, device_id, bytes(range(100, 116)))
    box.link.set_keys({SENSOR: spare})
    stand(box.pair(boot=2), 80.0)
    assert stage.taken() == 2 and holds(stage.target(), HANGING)


def test_without_a_pose_nothing_is_carried_over(evening: Evening) -> None:
    stage = evening()
    stage.dance(1.0)
    stage.silence(2.0)
    stage.dance(1.0, boot=NEXT_BOOT)
    assert stage.wants and all("stands still for a breath now" in message for message in stage.said)
    stage.stand(1.6, about_up(5.0), boot=NEXT_BOOT)
    assert stage.taken() == 1


def test_a_restart_of_the_imu_while_standing_still_begins_the_breath_anew(evening: Evening) -> None:
    stage = evening()
    stage.stand(1.2, about_up(5.0))
    stage.stand(1.2, about_up(6.0), restarts=1)
    assert stage.taken() == 0
    stage.stand(0.6, about_up(6.0), restarts=1)
    assert stage.taken() == 1 and holds(stage.target(), HANGING) is False  # it is led over
    stage.stand(0.6, about_up(6.0), restarts=1)
    assert holds(stage.target(), HANGING)
