"""The table of joint names: every usual system's names, what is not known, and the hand of a new show."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.outputs.osc.humanoid import humanoid_bones
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
        ("l_low_arm", ("arm", 1, 3, 0)),
        ("RightLowLeg", ("leg", -1, 2, 0)),
        ("torso_7", ("spine", 0, 3, 7)),
        ("Armature/LeftFoot", ("leg", 1, 4, 0)),
        ("Armature|Rig\\Hips", ("spine", 0, 0, 0)),
        ("mKneeLeft", ("leg", 1, 2, 0)),
        ("mHandIndex2Right", ("index", -1, 0, 2)),
        ("Spine1_M", ("spine", 0, 2, 1)),
        ("左ひじ", ("arm", 1, 3, 0)),
        ("右人指２", ("index", -1, 0, 2)),
        ("ひざ.L", ("leg", 1, 2, 0)),
        ("上半身2", ("spine", 0, 2, 2)),
    ],
)
def test_prefixes_sides_and_numbers(name: str, place: tuple[str, int, int, int]) -> None:
    assert place_of(name) == place


@pytest.mark.parametrize(
    "name", ["upperarm_twist_01_l", "ik_foot_root", "Tail", "bone12", "", "left", "_", "左足ＩＫ", "mouth"]
)
def test_a_name_that_is_not_in_the_table_means_nothing(name: str) -> None:
    assert place_of(name) is None


MOCOPI = "root torso_1 torso_2 torso_3 torso_4 torso_5 torso_6 torso_7 neck_1 neck_2 head"
MOCOPI += "".join(f" {s}_{w}" for s in "lr" for w in ("shoulder", "up_arm", "low_arm", "hand"))
MOCOPI += "".join(f" {s}_{w}" for s in "lr" for w in ("up_leg", "low_leg", "foot", "toes"))
BIOVISION = "Hips Chest Neck Head"
for _side in ("Left", "Right"):
    BIOVISION += "".join(
        f" {_side}{w}" for w in ("Collar", "UpArm", "LowArm", "Hand", "UpLeg", "LowLeg", "Foot")
    )
SECOND_LIFE = "mPelvis mTorso mChest mNeck mHead mSkull"
for _side in ("Left", "Right"):
    words = ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Foot", "Toe")
    SECOND_LIFE += "".join(f" m{w}{_side}" for w in words)
MMD = "全ての親 センター グルーブ 腰 上半身 上半身2 首 頭 左目"
for _side in "左右":
    MMD += "".join(
        f" {_side}{w}" for w in ("肩", "腕", "腕捩", "ひじ", "手首", "親指０", "足", "ひざ", "足首", "つま先")
    )
MMD += " 下半身 左足ＩＫ 右足ＩＫ"


@pytest.mark.parametrize(
    ("names", "some"),
    [
        (
            MOCOPI,
            {"hips": "root", "chest": "torso_7", "left forearm": "l_low_arm", "right shin": "r_low_leg"},
        ),
        (BIOVISION, {"left forearm": "LeftLowArm", "left collar": "LeftCollar", "right thigh": "RightUpLeg"}),
        (SECOND_LIFE, {"hips": "mPelvis", "left upper arm": "mShoulderLeft", "right foot": "mAnkleRight"}),
        (
            MMD,
            {
                "hips": "腰",
                "chest": "上半身2",
                "left upper arm": "左腕",
                "right thigh": "右足",
                "left hand": "左手首",
            },
        ),
    ],
)
def test_systems_of_one_s_own_naming(names: str, some: dict[str, str]) -> None:
    called = names.split()
    roles = roles_of(called)
    assert missing_roles(roles) == []
    assert {role: called[roles[role]] for role in some} == some
    bones = humanoid_bones(called)
    sides = [f"{side}{part}" for side in ("Left", "Right") for part in ("LowerArm", "LowerLeg", "Foot")]
    assert {"Hips", "Head", *sides} <= set(bones)


@pytest.mark.parametrize("prefix", ["Model_", "Actor01_", "Armature/", "Actor01", "my rig ", "Rig.001-"])
def test_a_prefix_of_most_joints_is_ignored_though_others_hang_from_the_rig(prefix: str) -> None:
    joints = skeleton_of("Mixamo").names
    bare = [name.removeprefix("mixamorig:") for name in joints]
    assert roles_of(["Reference", "ball", *(prefix + name for name in bare)]) == {
        role: joint + 2 for role, joint in roles_of(bare).items()
    }


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
