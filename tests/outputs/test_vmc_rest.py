"""VMC of any zero pose: an avatar in a T-pose, turned as the protocol says, takes the figure's pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.outputs.osc.vmc import Vmc
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.pose.stage_frame import in_stage_frame
from appliance.pose.t_pose import t_pose
from appliance.show_control.figure_pose import FigurePose
from appliance.show_control.vmc_input import BONE, VmcInput
from tests.outputs.small_stage import one_puppet, stand
from tests.outputs.test_vmc import MIRROR, matrix, sent
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of, skeleton_of

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
