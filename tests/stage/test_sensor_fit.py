"""Stood still for a breath, danced: the neutral pose is taken, and the joint turns as the dancer does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.pose import quaternion
from appliance.sensor.keys import SensorKey
from appliance.sensor.neutral import NeutralPose
from appliance.sensor.wire import IS_NDOF
from appliance.stage.sensor_memory import SensorMemory
from tests.sensor.peers import Box, Wearable
from tests.stage.worn import (
    BOOT,
    HAND,
    HANGING,
    NEXT_BOOT,
    SENSOR,
    TICK_S,
    Evening,
    Stage,
    about_front,
    about_up,
    holds,
    multiply,
)


def test_stood_still_for_a_breath_the_neutral_pose_is_taken_once(evening: Evening) -> None:
    stage = evening()
    assert not stage.wants  # nobody was heard yet
    stage.dance(1.0)
    assert stage.wants and stage.wearing.neutral_of(SENSOR) == "wanted"
    standing = multiply(about_up(130.0), about_front(20.0))
    stage.stand(1.4, standing)
    assert stage.wants and stage.taken() == 0
    stage.stand(0.7, standing)
    assert not stage.wants and stage.taken() == 1
    assert stage.wearing.neutral_of(SENSOR) == "taken"
    assert holds(stage.target(), HANGING)
    stage.dance(1.0)
    stage.stand(5.0, about_up(10.0))
    assert stage.taken() == 1
    assert stage.said[0] == f"Sensor {SENSOR} is on. Its dancer stands still for a breath now."
    assert len(stage.said) == 2


def test_from_the_neutral_pose_on_the_joint_turns_as_the_dancer_does(evening: Evening) -> None:
    stage = evening()
    standing = about_up(130.0)  # the arrow to the front, and that is where the sensor's north lies
    stage.stand(3.0, standing)
    raised = multiply(about_front(90.0), about_up(0.0))  # to the left side, about the front axis
    stage.stand(0.1, multiply(multiply(about_up(130.0), raised), about_up(0.0)))
    about_stage_front = quaternion.from_axis_angle([0, 0, 1], math.pi / 2)
    expected = quaternion.multiply(about_stage_front, np.array(HANGING))
    assert holds(stage.target(), tuple(expected.tolist()))


def test_the_pose_is_remembered_by_sensor_and_joint(evening: Evening, memory: SensorMemory) -> None:
    stage = evening([HAND, {"sensor": SENSOR, "joint": "lForeArm", "facing": [0, 1, 0]}])
    standing = about_up(40.0)
    stage.stand(2.5, standing)
    for joint in ("lShldr", "lForeArm"):
        assert memory.neutral(SENSOR, joint) == NeutralPose(standing, 0.0, BOOT)
    assert holds(stage.target("lShldr"), HANGING)
    assert holds(stage.target("lForeArm"), (1.0, 0.0, 0.0, 0.0))


def test_the_poses_of_all_joints_of_a_sensor_are_kept_in_one_write(
    evening: Evening, memory: SensorMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved: list[dict[str, NeutralPose]] = []
    monkeypatch.setattr(memory, "keep_neutral", lambda sensor, poses: saved.append(poses))
    stage = evening([HAND, {"sensor": SENSOR, "joint": "lForeArm"}])
    stage.stand(2.5, about_up(40.0))
    pose = NeutralPose(about_up(40.0), 0.0, BOOT)
    assert saved == [{"lShldr": pose, "lForeArm": pose}]


def test_an_arrow_that_points_down_is_complained_of_and_the_lid_tells_the_front(evening: Evening) -> None:
    stage = evening()
    arrow_down = multiply(about_up(70.0), (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0))
    stage.stand(2.5, arrow_down)
    assert holds(stage.target(), HANGING)
    assert len(stage.said) == 3
    assert "stood upright" in stage.said[2] and "lid" in stage.said[2] and "lShldr" in stage.said[2]
    stage.stand(0.1, multiply(about_up(30.0), arrow_down))  # turns to the left by 30 degrees
    turned_left = quaternion.from_axis_angle([0, 1, 0], math.radians(30.0))
    assert holds(stage.target(), tuple(quaternion.multiply(turned_left, np.array(HANGING)).tolist()))


def test_sensors_do_not_mind_each_other(evening: Evening) -> None:
    stage = evening([HAND, {"sensor": "right-wrist", "joint": "lForeArm"}])
    for _ in range(100):
        stage.hear(about_up(40.0))
        stage.hear(multiply(about_up(stage.sequence * 2.0), about_front(9.0)), sensor="right-wrist")
        stage.hear(about_up(0.0), sensor="stranger")
    assert stage.taken() == 1 and stage.taken("right-wrist") == 0
    assert stage.parts.link.wants_neutral == {"right-wrist"}


def test_a_double_tap_takes_the_pose_at_the_next_half_second_of_stillness(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(1.0, taps=0)
    stage.dance(0.5, taps=1)
    assert stage.wants
    stage.stand(0.4, about_up(70.0), taps=1)
    assert stage.taken() == 1
    stage.stand(0.8, about_up(70.0), taps=1)
    assert stage.taken() == 2 and not stage.wants
    assert holds(stage.target(), HANGING)
    stage.stand(3.0, about_up(20.0), taps=1)
    assert stage.taken() == 2


def test_stillness_before_the_tap_does_not_count(evening: Evening) -> None:
    stage = evening()
    stage.stand(4.0, about_up(40.0))
    stage.stand(0.4, about_up(40.0), taps=255)
    assert stage.taken() == 1
    stage.stand(0.2, about_up(40.0), taps=255)
    assert stage.taken() == 2
    stage.stand(0.6, about_up(40.0), taps=0)  # the counter wraps
    assert stage.taken() == 3


def test_who_taps_and_dances_on_keeps_the_pose_and_is_told(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(2.9, taps=1)
    assert stage.wants and len(stage.said) == 2
    stage.dance(0.2, taps=1)
    assert not stage.wants and len(stage.said) == 3
    assert "did not keep still within 3 s" in stage.said[2]
    stage.stand(0.5, about_up(40.0), taps=1)
    assert stage.taken() == 1 and holds(stage.target(), HANGING)


def test_a_tap_before_the_first_pose_leaves_it_wanted(evening: Evening) -> None:
    stage = evening()
    stage.dance(0.2)
    stage.dance(3.5, taps=1)
    assert stage.wants and "did not keep still" in stage.said[-1]
    stage.stand(1.6, about_up(40.0), taps=1)
    assert stage.taken() == 1


def test_a_sensor_that_falls_silent_while_asked_is_told_of_too(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.stand(0.1, about_up(40.0), taps=1)
    stage.silence(3.1)
    assert not stage.wants and "did not keep still" in stage.said[-1]


@pytest.mark.parametrize("asked", [SENSOR, None])
def test_a_person_may_ask_for_the_pose(evening: Evening, asked: str | None) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(1.0)
    stage.wearing.take_neutral(asked, stage.now)
    stage.stand(1.2, about_up(80.0))
    assert stage.taken() == 2 and holds(stage.target(), HANGING)


def test_a_dancer_who_stands_still_already_need_not_wait(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(1.0)
    stage.stand(1.0, about_up(80.0))
    stage.wearing.take_neutral(SENSOR, stage.now)
    stage.hear(about_up(80.0))
    assert stage.taken() == 2


@pytest.mark.parametrize("asked", [SENSOR, None])
def test_the_heading_alone_is_reset(evening: Evening, memory: SensorMemory, asked: str | None) -> None:
    stage = evening()
    stage.stand(2.5, about_up(40.0))
    drifted = multiply(about_up(25.0), about_up(40.0))
    stage.stand(0.5, drifted)
    assert not holds(stage.target(), HANGING)
    stage.wearing.reset_heading(asked, stage.now)
    stage.stand(0.6, drifted)
    assert holds(stage.target(), HANGING)
    assert stage.said[-1] == f"Sensor {SENSOR}: this is the front now. Dance."
    saved = memory.neutral(SENSOR, "lShldr")
    assert saved is not None and saved.heading == pytest.approx(math.radians(25.0))
    assert stage.taken() == 1 and not stage.wants


def test_a_heading_reset_before_any_pose_is_for_now_alone(evening: Evening, memory: SensorMemory) -> None:
    stage = evening()
    stage.dance(0.3)
    stage.hear(about_up(90.0))
    stage.wearing.reset_heading(SENSOR, stage.now)
    stage.stand(0.6, about_up(90.0))
    assert holds(stage.target(), HANGING)
    assert memory.neutral(SENSOR, "lShldr") is None and stage.wants


def test_upside_down_no_heading_is_reset(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(0.0))
    stage.stand(0.6, about_front(180.0))
    before = stage.target()
    stage.wearing.reset_heading(SENSOR, stage.now)
    stage.stand(0.6, about_front(180.0))
    assert "upside down" in stage.said[-1]
    assert (stage.target() == before).all()


def test_who_asks_for_a_stranger_or_a_silent_sensor_learns_that_nobody_is_asked(evening: Evening) -> None:
    stage = evening()
    with pytest.raises(ValueError, match=r"'left-wirst'.*Did you mean 'left-wrist'\?"):
        stage.wearing.take_neutral("left-wirst", stage.now)
    for asked in (SENSOR, None):
        assert not stage.wearing.take_neutral(asked, stage.now)
        assert not stage.wearing.reset_heading(asked, stage.now)
    assert stage.wearing.neutral_of("left-wirst") == ""
    assert stage.wearing.neutral_of(SENSOR) == "assumed"
    stage.stand(2.0, about_up(40.0))
    stage.silence(0.6)
    before = len(stage.said)
    assert not stage.wearing.take_neutral(SENSOR, stage.now)
    assert not stage.wearing.reset_heading(None, stage.now)
    stage.wearing.look(stage.now)
    assert len(stage.said) == before and not stage.wants


def test_who_is_heard_is_asked_though_another_sensor_is_silent(evening: Evening) -> None:
    stage = evening([HAND, {"sensor": "right-wrist", "joint": "lForeArm"}])
    stage.dance(1.0)
    assert stage.wearing.take_neutral(None, stage.now)
    assert not stage.wearing.take_neutral("right-wrist", stage.now)
    assert stage.parts.link.wants_neutral == {SENSOR}


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


def test_a_restart_of_the_box_keeps_the_pose_of_the_same_power_on(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    again = evening()
    again.stand(0.6, about_up(40.0))
    assert holds(again.target(), HANGING)
    assert not again.wants and again.taken() == 0
    assert again.said == [f"Sensor {SENSOR}: the neutral pose taken before is used on. Dance."]
    assert again.wearing.neutral_of(SENSOR) == "taken"


def test_another_night_begins_with_the_kept_pose_and_wants_a_new_one(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    tomorrow = evening()
    assert tomorrow.wearing.neutral_of(SENSOR) == "kept"
    tomorrow.stand(0.6, about_up(40.0), boot=NEXT_BOOT)
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
        shown.append(stage.parts.worn[SENSOR][0].local.copy())
    assert quaternion.angle_between(np.array(shown), before).max() < 0.01
    assert holds(stage.target(), before)
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
    again.stand(0.6, about_up(-60.0), boot=NEXT_BOOT)
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
