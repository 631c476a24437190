"""VMC: Unity's bone names, axes and chain, against an independent derivation with matrices."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from numpy.typing import NDArray
from pythonosc.osc_packet import OscPacket

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.outputs.osc.vmc import TIME_WRAP_S, Vmc
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.pose.stage_frame import in_stage_frame
from appliance.pose.t_pose import t_pose
from appliance.show_control.figure_pose import FigurePose
from appliance.show_control.vmc_input import BONE, VmcInput
from tests.outputs.conftest import JOINTS, fill
from tests.outputs.small_stage import encoded, one_puppet, stand
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of, skeleton_of

# The bone above each bone in Unity's humanoid, as far as the test's dancer has them.
UNITY_PARENT = {
    "Hips": "root", "Spine": "Hips", "Chest": "Spine", "Neck": "Chest", "Head": "Neck",
    "LeftShoulder": "Chest", "LeftUpperArm": "LeftShoulder", "LeftLowerArm": "LeftUpperArm",
    "LeftHand": "LeftLowerArm", "LeftIndexProximal": "LeftHand",
    "RightShoulder": "Chest", "RightUpperArm": "RightShoulder", "RightLowerArm": "RightUpperArm",
    "RightHand": "RightLowerArm",
    "LeftUpperLeg": "Hips", "LeftLowerLeg": "LeftUpperLeg", "LeftFoot": "LeftLowerLeg",
    "RightUpperLeg": "Hips", "RightLowerLeg": "RightUpperLeg", "RightFoot": "RightLowerLeg",
}  # fmt: skip
OURS = {
    "Hips": "hip", "Spine": "abdomen", "Chest": "chest", "Neck": "neck", "Head": "head",
    "LeftShoulder": "lCollar", "LeftUpperArm": "lShldr", "LeftLowerArm": "lForeArm", "LeftHand": "lHand",
    "LeftIndexProximal": "lIndex1", "RightShoulder": "rCollar", "RightUpperArm": "rShldr",
    "RightLowerArm": "rForeArm", "RightHand": "rHand", "LeftUpperLeg": "lThigh", "LeftLowerLeg": "lShin",
    "LeftFoot": "lFoot", "RightUpperLeg": "rThigh", "RightLowerLeg": "rShin", "RightFoot": "rFoot",
}  # fmt: skip
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


def sent(encoder: Vmc, frame: JointFrame) -> dict[str, list[float]]:
    """Bone name, or address of the other messages -> arguments."""
    found = {}
    for datagram in encoded(encoder, frame):
        for timed in OscPacket(bytes(datagram)).messages:
            address, arguments = timed.message.address, list(timed.message.params)
            found[str(arguments.pop(0)) if address == "/VMC/Ext/Bone/Pos" else address] = arguments
    return found


def matrix(position: NDArray[np.float64], x: float, y: float, z: float, w: float) -> NDArray[np.float64]:
    """4 x 4 transform of a unit quaternion and a position, written out."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), position[0]],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), position[1]],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), position[2]],
            [0, 0, 0, 1],
        ]
    )


def our_worlds(frame: JointFrame) -> dict[str, NDArray[np.float64]]:
    """Each joint's world transform, multiplied up with matrices from the local pose."""
    worlds: dict[str, NDArray[np.float64]] = {}
    for index, (name, parent, offset) in enumerate(JOINTS):
        w, x, y, z = map(float, frame.puppets[0].pose[index])
        if parent is None:
            worlds[name] = matrix(frame.puppets[0].root.astype(float), x, y, z, w)
        else:
            worlds[name] = worlds[parent] @ matrix(np.array(offset), x, y, z, w)
    return worlds


@pytest.mark.parametrize("seed", range(5))
def test_unity_s_chain_arrives_at_the_mirrored_dancer(skeleton: Skeleton, seed: int) -> None:
    frame = fill(one_puppet(len(skeleton)), skeleton, seed)
    messages = sent(Vmc(skeleton), frame)
    p, q = messages["/VMC/Ext/Root/Pos"][1:4], messages["/VMC/Ext/Root/Pos"][4:]
    unity = {"root": matrix(np.array(p), *q)}
    ours = our_worlds(frame)
    for bone, above in UNITY_PARENT.items():
        unity[bone] = unity[above] @ matrix(np.array(messages[bone][:3]), *messages[bone][3:])
        np.testing.assert_allclose(unity[bone], MIRROR @ ours[OURS[bone]] @ MIRROR, atol=2e-6)


def test_exactly_the_bones_with_a_unity_name_are_sent(skeleton: Skeleton, frame: JointFrame) -> None:
    others = {"/VMC/Ext/OK", "/VMC/Ext/T", "/VMC/Ext/Root/Pos"}
    assert set(sent(Vmc(skeleton), frame)) == set(UNITY_PARENT) | others


HALF = sin(pi / 4)


@pytest.mark.parametrize(
    ("joint", "ours_wxyz", "bone", "unity_xyzw"),
    [
        # The left arm from its side up: in Unity it points to -X and turns towards +Y, which is about -Z.
        ("lShldr", (HALF, 0, 0, HALF), "LeftUpperArm", (0, 0, -HALF, HALF)),
        # A quarter turn to the dancer's left: Unity's Z turns towards -X, which is about -Y.
        ("hip", (HALF, 0, HALF, 0), "Hips", (0, -HALF, 0, HALF)),
        # A nod: in both Z turns towards -Y, which is about +X.
        ("head", (cos(0.3), sin(0.3), 0, 0), "Head", (sin(0.3), 0, 0, cos(0.3))),
    ],
)
def test_known_movements_have_unity_s_signs(
    skeleton: Skeleton,
    joint: str,
    ours_wxyz: tuple[float, ...],
    bone: str,
    unity_xyzw: tuple[float, ...],
) -> None:
    frame = one_puppet(len(skeleton))
    frame.puppets[0].pose[skeleton.index(joint)] = ours_wxyz
    stand(frame, skeleton)
    np.testing.assert_allclose(sent(Vmc(skeleton), frame)[bone][3:], unity_xyzw, atol=1e-6)


def test_the_left_hand_is_on_unity_s_left(skeleton: Skeleton) -> None:
    frame = one_puppet(len(skeleton))
    frame.puppets[0].root[:] = 1.0, 0.9, 2.0
    stand(frame, skeleton)
    messages = sent(Vmc(skeleton), frame)
    np.testing.assert_allclose(messages["Hips"][:3], [-1.0, 0.9, 2.0], atol=1e-6)
    np.testing.assert_allclose(messages["LeftLowerArm"][:3], [-0.28, -0.017, 0.005], atol=1e-6)
    np.testing.assert_allclose(messages["LeftUpperLeg"][:3], [-0.09, 0.02, -0.008], atol=1e-6)


def test_ok_says_loaded_and_calibrated_and_time_runs_in_seconds(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    encoder = Vmc(skeleton)
    start = frame.frame_time = 4e6  # 46 days after power-on
    assert sent(encoder, frame)["/VMC/Ext/OK"] == [1, 3, 0]
    assert sent(encoder, frame)["/VMC/Ext/T"] == [0.0]
    frame.frame_time = start + 12.5
    assert sent(encoder, frame)["/VMC/Ext/T"] == [12.5]


def test_time_tells_neighbouring_ticks_apart_for_as_long_as_a_show_may_run(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    encoder = Vmc(skeleton)
    start = frame.frame_time
    encoded(encoder, frame)
    times = []
    for tick in range(10):
        frame.frame_time = start + TIME_WRAP_S - 1.0 + 0.02 * tick
        times += sent(encoder, frame)["/VMC/Ext/T"]
    assert len(set(times)) == 10


MOTIONBUILDER = [
    "Hips", "LHipJoint", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", "LowerBack", "Spine", "Spine1",
    "Neck", "Neck1", "Head", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "LeftFingerBase",
    "LeftHandIndex1", "LThumb",
]  # fmt: skip


def test_names_of_motionbuilder_and_mixamo() -> None:
    expected = {
        "Hips": "Hips", "LeftUpperLeg": "LeftUpLeg", "LeftLowerLeg": "LeftLeg", "LeftFoot": "LeftFoot",
        "LeftToes": "LeftToeBase", "Spine": "Spine", "Chest": "Spine1", "Neck": "Neck", "Head": "Head",
        "LeftShoulder": "LeftShoulder", "LeftUpperArm": "LeftArm", "LeftLowerArm": "LeftForeArm",
        "LeftHand": "LeftHand", "LeftIndexProximal": "LeftHandIndex1", "LeftThumbProximal": "LThumb",
    }  # fmt: skip
    assert {bone: MOTIONBUILDER[joint] for bone, joint in humanoid_bones(MOTIONBUILDER).items()} == expected
    mixamo = [f"mixamorig:{name}" for name in MOTIONBUILDER]
    assert humanoid_bones(mixamo) == humanoid_bones(MOTIONBUILDER)


def test_xsens_shoulders_are_upper_arms_because_there_are_collars() -> None:
    right = ["RightCollar", "RightShoulder", "RightElbow", "RightWrist"]
    names = ["Hips", "Chest", *right, "LeftHip", "LeftKnee", "LeftAnkle"]
    assert {bone: names[joint] for bone, joint in humanoid_bones(names).items()} == {
        "Hips": "Hips", "Chest": "Chest", "RightShoulder": "RightCollar", "RightUpperArm": "RightShoulder",
        "RightLowerArm": "RightElbow", "RightHand": "RightWrist",
        "LeftUpperLeg": "LeftHip", "LeftLowerLeg": "LeftKnee", "LeftFoot": "LeftAnkle",
    }  # fmt: skip


def test_a_root_without_a_known_name_is_the_hips(frame: JointFrame) -> None:
    assert humanoid_bones(["body", "lForeArm", "leftover"]) == {"Hips": 0, "LeftLowerArm": 1}


LIMBS = [
    (f"{side}{start}", f"{side}{end}")
    for side in ("Left", "Right")
    for start, end in (
        ("UpperArm", "LowerArm"),
        ("LowerArm", "Hand"),
        ("UpperLeg", "LowerLeg"),
        ("LowerLeg", "Foot"),
    )
]
WAYS_DEGREES, TWIST_DEGREES = 2.0, 20.0


def posed_avatar(messages: dict[str, list[float]]) -> dict[str, NDArray[np.float64]]:
    """World transforms of an avatar of Unity's with all bones: a T-pose in which no bone is turned, given the
    rotations; a bone that none was sent for stays as it is."""
    body = skeleton_of("Mixamo")
    joint_of = humanoid_bones(body.names)
    bone_of = {joint: bone for bone, joint in joint_of.items()}
    posed: dict[str, NDArray[np.float64]] = {}
    for joint, parent in enumerate(body.parents):
        bone, offset = bone_of[joint], body.offsets[joint] * [-1, 1, 1]
        if parent < 0:
            posed[bone] = matrix(np.array(messages[bone][:3]), *messages[bone][3:])
        else:
            turn = messages[bone][3:] if bone in messages else (0.0, 0.0, 0.0, 1.0)
            posed[bone] = posed[bone_of[parent]] @ matrix(offset, *turn)
    return posed


def returned(skeleton: Skeleton, messages: dict[str, list[float]]) -> NDArray[np.float32]:
    """The pose (J, 4) that another box takes from these messages."""
    heard = VmcInput(FigurePose(skeleton))
    bones = {name: m for name, m in messages.items() if "/" not in name}
    for _ in range(2):  # of the first frame nobody knows where it ends
        for name, numbers in bones.items():
            found = heard.hear(BONE, [name, *numbers])
    assert found is not None
    return np.array(found[1], np.float32).reshape(-1, 4)


def degrees(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    cosine = float(one @ other) / float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_an_avatar_takes_the_pose_of_every_system_s_figure(convention: str) -> None:
    meant = dance_of(convention, 4.0)
    given, _ = in_stage_frame(as_the_system_writes(meant, convention))
    skeleton = given.skeleton
    encoder, frame = Vmc(skeleton), one_puppet(len(skeleton))
    joint_of = humanoid_bones(skeleton.names)
    in_t_pose = meant.skeleton.forward_kinematics(meant.poses, meant.roots, meant.translations)[1]
    for number in (0, 90, 199):
        frame.puppets[0].pose[:], frame.puppets[0].root[:] = given.poses[number], given.roots[number]
        stand(frame, skeleton)
        avatar = posed_avatar(sent(encoder, frame))
        for start, end in LIMBS:
            positions = frame.puppets[0].positions
            ours = (positions[joint_of[end]] - positions[joint_of[start]]) * [-1, 1, 1]
            theirs = avatar[end][:3, 3] - avatar[start][:3, 3]
            assert degrees(ours.astype(float), theirs) < WAYS_DEGREES, (number, start)
        came_back = returned(skeleton, sent(encoder, frame))
        angles = np.degrees(quaternion.angle_between(came_back, frame.puppets[0].pose))
        assert angles[sorted(joint_of.values())].max() < 0.1
        for bone, joint in joint_of.items():
            w, x, y, z = in_t_pose[number, meant.skeleton.index(skeleton.names[joint])]
            turned = (MIRROR @ matrix(np.zeros(3), x, y, z, w) @ MIRROR)[:3, :3]
            for column in range(3):
                assert degrees(avatar[bone][:3, column], turned[:, column]) < TWIST_DEGREES, (number, bone)


def test_the_rest_is_upright_from_hips_to_head_whatever_the_stance_bends() -> None:
    given = in_stage_frame(as_the_system_writes(dance_of("LAFAN", 2.0), "LAFAN"))[0].skeleton
    assert given.stance is not None
    bent, between = given.stance.copy(), given.index("Spine1")  # a joint without a role
    bent[between] = quaternion.multiply(quaternion.from_axis_angle([0.0, 1.0, 0.0], 0.6), bent[between])
    rest = t_pose(replace(given, stance=bent)).positions
    up = rest[given.roles["head"]] - rest[given.roles["spine"]]
    assert up[1] > 0.999 * np.linalg.norm(up)
