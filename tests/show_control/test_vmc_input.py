"""A dancer by VMC: what the box sends comes back as the same dance; known movements are as in Unity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest
from pythonosc.udp_client import SimpleUDPClient

from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.receivers import OscOutputs
from appliance.pose import quaternion
from appliance.show.osc import OscConfig
from appliance.show.sources import LIVE
from appliance.show_control.vmc_input import BONE, ROOT, VmcInput
from hw_sim.osc_receiver import OscReceiver, Received
from tests.outputs.conftest import fill
from tests.show_control.doubles import FIGURE, HOST, Asker, ControlInThread, StageDouble, facts
from tests.system.processes import wait_until

HALF = sin(pi / 4)
REST = (0.0, 0.0, 0.0, 1.0)


@pytest.fixture
def stage(folder: Path) -> Iterator[StageDouble]:
    show = facts()
    with StageDouble(folder, replace(show, phrases=(*show.phrases, LIVE))) as stage:
        yield stage


def sent(frame: JointFrame) -> list[Received]:
    """The messages of one frame in the box's own vmc dialect, decoded by the simulation."""
    with OscReceiver(HOST) as receiver:
        outputs = OscOutputs([OscConfig(port=receiver.port, dialect="vmc")], FIGURE)
        with closing(outputs):
            outputs.send_frame(frame)
            messages: list[Received] = []
            while not any("RightFoot" in arguments for _, _, arguments in messages):
                found = receiver.poll(60.0)
                assert found, "no datagram came"
                messages += found
    return messages


def standing(frame: JointFrame, root: Sequence[float]) -> JointFrame:
    frame.root[:] = root
    frame.positions[:], frame.world[:] = FIGURE.forward_kinematics(frame.pose, frame.root)
    return frame


def test_the_boxs_own_vmc_comes_back_as_the_same_dance(
    folder: Path, stage: StageDouble, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    client = SimpleUDPClient(HOST, control.port)
    with closing(LivePoseReader(folder)) as reader:
        for seed in (1, 2):
            frame = fill(JointFrame(len(FIGURE)), FIGURE, seed)
            for _ in range(2):  # of the first frame nobody knows where it ends
                for _, address, arguments in sent(frame):
                    client.send_message(address, arguments)

            def same(frame: JointFrame = frame) -> LivePose | None:
                heard = reader.read()
                if heard is None:
                    return None
                turned = np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)
                positions, world = FIGURE.forward_kinematics(turned, np.array(heard.root, np.float32))
                is_same = float(quaternion.angle_between(world, frame.world).max()) < 2e-3
                return heard if is_same and np.allclose(positions, frame.positions, atol=1e-4) else None

            wait_until(same, "the dance did not come back", pause=lambda: None)


@pytest.mark.parametrize(
    ("bone", "unity", "joint", "ours"),
    [
        # Unity's left arm points to -X; a quarter turn about -Z lifts it.
        ("LeftUpperArm", (0, 0, -HALF, HALF), "lShldr", (HALF, 0, 0, HALF)),
        ("leftUpperArm", (0, 0, -HALF, HALF), "lShldr", (HALF, 0, 0, HALF)),  # as VRM 1 spells it
        ("Hips", (0, -HALF, 0, HALF), "Hips", (HALF, 0, HALF, 0)),  # a turn to the dancer's left
        ("Spine", (sin(0.3), 0, 0, np.cos(0.3)), "Chest", None),  # this figure has a chest alone
    ],
)
def test_known_movements_come_with_the_boxs_signs(
    bone: str, unity: Sequence[float], joint: str, ours: Sequence[float] | None
) -> None:
    vmc = VmcInput(FIGURE)
    vmc.hear(BONE, [bone, 0, 0, 0, *unity])
    whole = vmc.hear(BONE, [bone, 0, 0, 0, *unity])
    assert whole is not None
    pose = np.array(whole[1]).reshape(-1, 4)
    np.testing.assert_allclose(pose[FIGURE.index(joint)], ours or (1, 0, 0, 0), atol=1e-12)
    others = np.delete(pose, FIGURE.index(joint), axis=0)
    np.testing.assert_array_equal(others, np.tile([1, 0, 0, 0], (len(FIGURE) - 1, 1)))


def test_the_root_carries_the_hips_and_may_say_more() -> None:
    vmc = VmcInput(FIGURE)
    quarter = (0, HALF, 0, HALF)  # in Unity: +Z goes to +X, which is the dancer's right
    vmc.hear(ROOT, ["root", 1, 0, 2, *quarter, 1, 1, 1, 0, 0, 0])
    vmc.hear(BONE, ["Hips", 0, 0.9, 1, *REST])
    whole = vmc.hear(BONE, ["Hips", 0, 0.9, 1, *REST])
    assert whole is not None
    np.testing.assert_allclose(whole[0], [-2, 0.9, 2], atol=1e-9)
    np.testing.assert_allclose(whole[1][:4], [HALF, 0, -HALF, 0], atol=1e-9)


def test_without_hips_the_place_is_unknown() -> None:
    vmc = VmcInput(FIGURE)
    vmc.hear(BONE, ["LeftUpperArm", 0, 0, 0, *REST])
    whole = vmc.hear(BONE, ["LeftUpperArm", 0, 0, 0, *REST])
    assert whole is not None and np.isnan(whole[0]).all()


def test_a_frame_comes_once_as_soon_as_its_last_bone_has_come() -> None:
    vmc, bones = VmcInput(FIGURE), ["Hips", "Chest", "LeftUpperArm"]
    poses = [[vmc.hear(BONE, [bone, 0, 0, 0, *REST]) for bone in bones] for _ in range(4)]
    came = [[pose is not None for pose in frame] for frame in poses]
    assert came == [[False] * 3, [True, False, True], [False, False, True], [False, False, True]]
    assert vmc.hear(BONE, ["Hips", 0, 0, 0, *REST]) is None
    assert vmc.hear(BONE, ["Hips", 0, 0, 0, *REST]) is not None  # bones are lost: the frame ends all the same


@pytest.mark.parametrize(
    "arguments",
    [[], ["Hips"], [1, 0, 0, 0, *REST], ["Hips", 0, 0, np.nan, *REST], ["Hips", "x", 0, 0, *REST]],
)
def test_what_is_no_bone_is_refused_in_words(
    stage: StageDouble, asker: Asker, arguments: list[object]
) -> None:
    asker.ask("/ping")
    reply = asker.ask(BONE, *arguments)
    assert reply[1:3] == [BONE, 0] and "a name and seven numbers" in reply[3]


def test_faces_and_cameras_are_passed_over(folder: Path, control: ControlInThread, asker: Asker) -> None:
    with StageDouble(folder):
        asker.ask("/ping")
        asker.tell("/VMC/Ext/Blend/Val", "Joy", 1.0)
        asker.tell("/VMC/Ext/OK", 1)
        assert asker.ask("/ping") == ["/pong"]
        assert "live: true" in asker.ask(BONE, "Hips", 0.0, 0.0, 0.0, *REST)[3]
