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
from appliance.levers.sources import LIVE
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.receivers import OscOutputs
from appliance.pose import quaternion
from appliance.show.osc import OscConfig
from appliance.show_control.figure_pose import FigurePose
from appliance.show_control.vmc_input import BONE, ROOT, VmcInput
from hw_sim.osc_receiver import OscReceiver, Received
from tests.outputs.conftest import fill
from tests.outputs.small_stage import one_puppet, stand
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
    frame.puppets[0].root[:] = root
    stand(frame, FIGURE)
    return frame


def test_the_boxs_own_vmc_comes_back_as_the_same_dance(
    folder: Path, stage: StageDouble, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    client = SimpleUDPClient(HOST, control.port)
    with closing(LivePoseReader(folder)) as reader:
        for seed in (1, 2):
            frame = fill(one_puppet(len(FIGURE)), FIGURE, seed)
            for _ in range(2):  # of the first frame nobody knows where it ends
                for _, address, arguments in sent(frame):
                    client.send_message(address, arguments)

            def same(frame: JointFrame = frame) -> LivePose | None:
                heard = reader.read()
                if heard is None:
                    return None
                turned = np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)
                positions, world = FIGURE.forward_kinematics(turned, np.array(heard.root, np.float32))
                is_same = float(quaternion.angle_between(world, frame.puppets[0].world).max()) < 2e-3
                is_same &= np.allclose(positions, frame.puppets[0].positions, atol=1e-4)
                return heard if is_same else None

            wait_until(same, "the dance did not come back", pause=lambda: None)


@pytest.mark.parametrize(
    ("bone", "unity", "joint", "ours"),
    [
        # Unity's left arm points to -X; a quarter turn about -Z lifts it.
        ("LeftUpperArm", (0, 0, -HALF, HALF), "lShldr", (HALF, 0, 0, HALF)),
        ("leftUpperArm", (0, 0, -HALF, HALF), "lShldr", (HALF, 0, 0, HALF)),  # as VRM 1 spells it
        ("Hips", (0, -HALF, 0, HALF), "Hips", (HALF, 0, HALF, 0)),  # a turn to the dancer's left
    ],
)
def test_known_movements_come_with_the_boxs_signs(
    bone: str, unity: Sequence[float], joint: str, ours: Sequence[float]
) -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    vmc.hear(BONE, [bone, 0, 0, 0, *unity])
    whole = vmc.hear(BONE, [bone, 0, 0, 0, *unity])
    assert whole is not None
    pose = np.array(whole[1]).reshape(-1, 4)
    np.testing.assert_allclose(pose[FIGURE.index(joint)], ours, atol=1e-12)
    assert np.isnan(np.delete(pose, FIGURE.index(joint), axis=0)).all()  # these stay with the phrase


def test_the_root_carries_the_hips_and_may_say_more() -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    quarter = (0, HALF, 0, HALF)  # in Unity: +Z goes to +X, which is the dancer's right
    vmc.hear(ROOT, ["root", 1, 0, 2, *quarter, 1, 1, 1, 0, 0, 0])
    vmc.hear(BONE, ["Hips", 0, 0.9, 1, *REST])
    whole = vmc.hear(BONE, ["Hips", 0, 0.9, 1, *REST])
    assert whole is not None
    np.testing.assert_allclose(whole[0], [-2, 0.9, 2], atol=1e-9)
    np.testing.assert_allclose(whole[1][:4], [HALF, 0, -HALF, 0], atol=1e-9)


def frame(vmc: VmcInput, *bones: str) -> np.ndarray:
    """The pose of the second of two frames of these bones."""
    for _ in range(2):
        for bone in bones:
            whole = vmc.hear(BONE, [bone, 0, 0, 0, *REST])
    assert whole is not None
    return np.array(whole[1]).reshape(-1, 4)


def test_a_bone_that_this_figure_lacks_says_nothing() -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    for _ in range(3):
        assert vmc.hear(BONE, ["Spine", 0, 0, 0, *REST]) is None  # it has a chest only
    assert not vmc.known


def test_a_joint_between_two_bones_comes_with_the_lower_one() -> None:
    between = replace(FIGURE, names=("Hips", "Twist", "lShldr", "lForeArm", *FIGURE.names[4:]))
    for bones, joints in ((("Hips",), {0}), (("Hips", "LeftUpperArm"), {0, 1, 2})):
        pose = frame(VmcInput(FigurePose(between)), *bones)
        assert set(np.flatnonzero(np.isfinite(pose).all(axis=1))) == joints


def test_a_bone_that_is_sent_as_nothing_but_zeros_does_not_come() -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    for _ in range(3):
        vmc.hear(BONE, ["LeftUpperArm", 0, 0, 0, 0, 0, 0, 0])
        whole = vmc.hear(BONE, ["Hips", 0, 0, 0, *REST])
    assert whole is not None and vmc.known == {"Hips"}


def test_a_bone_that_is_lost_once_is_not_missing() -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    frame(vmc, "Hips", "Chest", "LeftUpperArm")
    for bone in ("Hips", "LeftUpperArm", "Hips"):
        whole = vmc.hear(BONE, [bone, 0, 0, 0, *REST])
    assert whole is not None and np.isfinite(np.array(whole[1]).reshape(-1, 4)[FIGURE.index("Chest")]).all()
    frame(vmc, "Hips", "LeftUpperArm")
    frame(vmc, "Hips", "LeftUpperArm")
    assert vmc.known == {"Hips", "LeftUpperArm"}


def test_names_from_outside_never_stay_in_memory() -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    for number in range(10_000):
        vmc.hear(BONE, [f"Bone{number}", 0, 0, 0, *REST])
    assert not vmc.known
    assert sum(map(len, (vmc._came, vmc._whole, vmc._turns))) < 60


@pytest.mark.parametrize(
    ("address", "arguments"),
    [
        (ROOT, ["root", 1e39, 0, 0, *REST]),
        (ROOT, ["root", 0, -5000.0, 0, *REST]),
        (BONE, ["Hips", 0, 0, 1e300, *REST]),
        (BONE, ["Chest", 0, 0, 0, 0, 0, 0, 1e39]),
        (BONE, ["Chest", 0, 0, 0, 0, 0, 0, 0.5]),
    ],
)
def test_numbers_that_no_figure_has_are_refused(address: str, arguments: list[object]) -> None:
    with pytest.raises(ValueError, match=r"farther than 1000 m|length 1"):
        VmcInput(FigurePose(FIGURE)).hear(address, arguments)


def test_the_place_of_a_bone_that_does_not_count_may_be_anything() -> None:
    VmcInput(FigurePose(FIGURE)).hear(BONE, ["Chest", 1e39, 0, 0, *REST])


def test_without_hips_the_place_is_unknown() -> None:
    vmc = VmcInput(FigurePose(FIGURE))
    vmc.hear(BONE, ["LeftUpperArm", 0, 0, 0, *REST])
    whole = vmc.hear(BONE, ["LeftUpperArm", 0, 0, 0, *REST])
    assert whole is not None and np.isnan(whole[0]).all()


def test_a_frame_comes_once_as_soon_as_its_last_bone_has_come() -> None:
    vmc, bones = VmcInput(FigurePose(FIGURE)), ["Hips", "Chest", "LeftUpperArm"]
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
