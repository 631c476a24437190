"""The table of joint names: every usual system's names, what is not known, and the hand of a new show."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose.joint_names import place_of, side_of
from appliance.pose.roles import LIMBS, missing_roles, roles_of
from appliance.pose.skeleton import Skeleton
from tests.pose.conventions import CONVENTIONS, skeleton_of


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_joints_of_the_usual_systems_are_known(convention: str) -> None:
    given = CONVENTIONS[convention]
    skeleton = skeleton_of(convention)
    named = {role: skeleton.names[joint] for role, joint in skeleton.roles.items()}
    assert missing_roles(skeleton.roles) == []
    for role, name in given.roles().items():
        assert named.get(role) == name, role
    known = {joint for role, joint in skeleton.roles.items() if not role.endswith("collar")}
    assert len(known) == len(skeleton.roles) - sum(role.endswith("collar") for role in skeleton.roles)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_two_sides_are_told_apart(convention: str) -> None:
    skeleton = skeleton_of(convention)
    for role in LIMBS:
        for side, number in (("left", 1), ("right", -1)):
            if (joint := skeleton.roles.get(f"{side} {role}")) is not None:
                assert side_of(skeleton.names[joint]) == number


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("UpperArm_L", ("arm", 1, 2, 0)),
        ("upper_arm.L", ("arm", 1, 2, 0)),
        ("mixamorig1:LeftUpLeg", ("leg", 1, 1, 0)),
        ("J_Bip_R_LowerArm", ("arm", -1, 3, 0)),
        ("joint_ClavicleLT", ("arm", 1, 0, 0)),
        ("Bip01 R Thigh", ("leg", -1, 1, 0)),
        ("spine_03", ("spine", 0, 2, 3)),
        ("T12", ("spine", 0, 3, 0)),
        ("lIndex2", ("index", 1, 0, 2)),
        ("IndexProximal_L", ("index", 1, 0, 1)),
        ("RightFinger5Medial", ("pinky", -1, 0, 2)),
        ("lShldrBend", ("arm", 1, 2, 0)),
        ("abdomenUpper", ("spine", 0, 1, 0)),
    ],
)
def test_prefixes_sides_and_numbers(name: str, place: tuple[str, int, int, int]) -> None:
    assert place_of(name) == place


@pytest.mark.parametrize("name", ["upperarm_twist_01_l", "ik_foot_root", "Tail", "bone12", "", "left", "_"])
def test_a_name_that_is_not_in_the_table_means_nothing(name: str) -> None:
    assert place_of(name) is None


def test_a_performer_s_name_in_front_of_all_joints_is_ignored() -> None:
    assert roles_of(["Anna_Hips", "Anna_LeftArm", "Anna_RightUpLeg"]) == {
        "hips": 0,
        "left upper arm": 1,
        "right thigh": 2,
    }


def test_a_shoulder_is_a_collar_only_beside_an_upper_arm() -> None:
    assert roles_of(["LeftShoulder", "LeftArm"])["left upper arm"] == 1
    assert roles_of(["LeftCollar", "LeftShoulder", "LeftElbow"])["left upper arm"] == 1
    assert roles_of(["LeftShoulder", "LeftElbow"])["left upper arm"] == 0


def test_feet_are_joints_of_the_body_and_no_handles_beside_it() -> None:
    names = ("root", "pelvis", "foot_l", "foot_r", "ik_foot_l", "ik_foot_r")
    skeleton = Skeleton(names, (-1, 0, 1, 1, 0, 0), np.zeros((6, 3)))
    assert skeleton.feet == (2, 3)
