"""Stood still for a breath, danced: the neutral pose is taken, and the joint turns as the dancer does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.sensor.neutral import NeutralPose
from appliance.stage.sensor_memory import SensorMemory
from tests.stage.worn import BOOT, HAND, HANGING, SENSOR, Evening, about_front, about_up, holds, multiply


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
