"""VMC: Unity's bone names, axes and chain, against an independent derivation with matrices."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from numpy.typing import NDArray
from pythonosc.osc_packet import OscPacket

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.outputs.osc.vmc import TIME_WRAP_S, Vmc
from appliance.pose.skeleton import Skeleton
from tests.outputs.conftest import JOINTS, fill
from tests.outputs.small_stage import encoded, one_puppet, stand

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
