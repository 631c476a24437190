"""What follows the puppet: forward kinematics of the figure and packing it into OSC."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pythonosc.osc_message_builder import OscMessageBuilder

from appliance.dancer.figure import Figure
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.dialects import DIALECTS
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from tests.studio.tiny import skeleton, swaying

FIGURE_GROUP = "forward kinematics of one pose"
OSC_GROUP = "one frame packed into OSC, dialect ai-toolbox"
DIALECTS_GROUP = "one frame packed into OSC, the other dialects"


@pytest.fixture
def frame() -> JointFrame:
    """A pose of the tiny figure."""
    made = JointFrame(len(skeleton()))
    dance = swaying(1.0)
    made.pose[:] = dance.poses[7]
    positions, world = skeleton().forward_kinematics(made.pose, dance.roots[7].astype(np.float32))
    made.positions[:], made.world[:] = positions, world
    return made


def message(address: str, floats: list[float]) -> bytes:
    builder = OscMessageBuilder(address)
    for number in floats:
        builder.add_arg(number, "f")
    return bytes(builder.build().dgram)


def pack_with_python_osc(frame: JointFrame) -> list[bytes]:
    """The same three messages as the ai-toolbox dialect."""
    return [
        message("/mocap/0/joint/rot_local", frame.pose.ravel().tolist()),
        message("/mocap/0/joint/pos_world", frame.positions.ravel().tolist()),
        message("/mocap/0/joint/rot_world", frame.world.ravel().tolist()),
    ]


def test_python_osc(measured: Callable[..., Any], frame: JointFrame) -> None:
    benchmark = measured("python-osc", OSC_GROUP, reference=True)
    packed = benchmark(pack_with_python_osc, frame)
    ours = DIALECTS["ai-toolbox"](skeleton()).encode(frame)
    assert packed == [bytes(datagram) for datagram in ours]


def test_ai_toolbox(measured: Callable[..., Any], frame: JointFrame) -> None:
    encoder = DIALECTS["ai-toolbox"](skeleton())
    assert len(measured("ours", OSC_GROUP)(encoder.encode, frame)) == 3


@pytest.mark.parametrize("dialect", sorted(DIALECTS.keys() - {"ai-toolbox"}))
def test_dialect(measured: Callable[..., Any], frame: JointFrame, dialect: str) -> None:
    encoder = DIALECTS[dialect](skeleton())
    assert measured(dialect, DIALECTS_GROUP)(encoder.encode, frame)


def one_joint_after_another(bones: Skeleton, pose: Any, root: Any) -> list[Any]:
    """Forward kinematics as textbooks write it."""
    world: list[Any] = []
    positions: list[Any] = []
    for joint, parent in enumerate(bones.parents):
        if parent < 0:
            world.append(pose[joint])
            positions.append(root)
            continue
        world.append(quaternion.multiply(world[parent], pose[joint]))
        positions.append(positions[parent] + quaternion.rotate(world[parent], bones.offsets[joint]))
    return positions


def test_forward_kinematics_joint_by_joint(measured: Callable[..., Any], frame: JointFrame) -> None:
    benchmark = measured("joint by joint", FIGURE_GROUP, reference=True)
    positions = benchmark(one_joint_after_another, skeleton(), frame.pose, frame.positions[0])
    np.testing.assert_allclose(positions, frame.positions, atol=1e-5)


def test_forward_kinematics_of_many_poses(measured: Callable[..., Any], frame: JointFrame) -> None:
    benchmark = measured("skeleton, any shape", FIGURE_GROUP)
    positions, _ = benchmark(skeleton().forward_kinematics, frame.pose, frame.positions[0])
    np.testing.assert_allclose(positions, frame.positions, atol=1e-5)


def test_forward_kinematics_in_the_tick(measured: Callable[..., Any], frame: JointFrame) -> None:
    figure = Figure(skeleton())
    measured("figure, in the tick", FIGURE_GROUP)(figure.stand, frame.pose, frame.positions[0])
    np.testing.assert_allclose(figure.positions, frame.positions, atol=1e-5)
