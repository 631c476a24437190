"""The joint that a new show gives to its first sensor: the left upper arm, whatever it is called."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from appliance.pose.stage_frame import in_stage_frame
from appliance.studio.data.mirror import mirror_pairs
from appliance.studio.export.release import first_hand, hanging_orientation
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of, skeleton_of


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_first_hand_is_the_upper_arm(convention: str) -> None:
    skeleton = skeleton_of(convention)
    assert first_hand(skeleton, skeleton.names) == (CONVENTIONS[convention].name("left upper arm"), "")
    pairs = mirror_pairs(skeleton)
    assert pairs[skeleton.roles["left toe"]] == skeleton.roles["right toe"]


def test_an_unknown_name_is_told_and_the_shape_decides() -> None:
    skeleton = skeleton_of("Mixamo")
    nameless = replace(skeleton, names=tuple(f"bone{number}" for number in range(len(skeleton))))
    name, doubt = first_hand(nameless, nameless.names)
    assert nameless.index(name) == skeleton.roles["left upper arm"]
    assert "No joint has a name that is known for an arm" in doubt and name in doubt


def test_an_upper_arm_that_does_not_move_is_told() -> None:
    skeleton = skeleton_of("Unreal")
    name, doubt = first_hand(skeleton, [n for n in skeleton.names if n != "upperarm_l"])
    assert name == "lowerarm_l"
    assert "The left upper arm does not move" in doubt


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_arm_of_a_dancer_who_stands_still_hangs(convention: str) -> None:
    skeleton = in_stage_frame(as_the_system_writes(dance_of(convention, 2.0), convention))[0].skeleton
    arm, elbow = (skeleton.roles[f"left {part}"] for part in ("upper arm", "forearm"))
    neutral = hanging_orientation(skeleton, skeleton.names[arm])
    assert neutral is not None
    pose = skeleton.standing.copy()
    pose[arm] = neutral
    places, _ = skeleton.forward_kinematics(pose, np.zeros(3))
    way = places[elbow] - places[arm]
    assert -way[1] > np.sin(np.radians(70.0)) * np.linalg.norm(way)


def test_what_is_no_upper_arm_stays_as_it_rests() -> None:
    skeleton = skeleton_of("Mixamo")
    for part in ("hips", "left forearm", "left hand", "head", "left thigh"):
        assert hanging_orientation(skeleton, skeleton.names[skeleton.roles[part]]) is None
