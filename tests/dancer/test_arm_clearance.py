"""Arms go around the trunk, smoothly, and an arm beside it is left alone."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.dancer.arm_clearance import ArmClearance
from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.trunk import Trunk
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.evaluation.dance_figures import BodyFigures, largest_step

NAMES = ("hip", "chest", "neck", "head", "lShldr", "lForeArm", "lHand", "rShldr", "rForeArm", "rHand")
PARENTS = (-1, 0, 1, 2, 1, 4, 5, 1, 7, 8)
OFFSETS = np.array(
    [
        *((0.0, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, 0.25, 0.0), (0.0, 0.1, 0.0)),
        *((0.2, 0.2, 0.0), (0.3, 0.0, 0.0), (0.25, 0.0, 0.0)),
        *((-0.2, 0.2, 0.0), (-0.3, 0.0, 0.0), (-0.25, 0.0, 0.0)),
    ]
)
FIGURE = Skeleton(NAMES, PARENTS, OFFSETS)
LEFT, ELBOW = NAMES.index("lShldr"), NAMES.index("lForeArm")
ACROSS = quaternion.from_axis_angle([0.0, 1.0, 0.0], -np.pi)  # to the right, straight through the chest


def rest(ticks: int) -> np.ndarray:
    return np.tile(quaternion.IDENTITY.astype(np.float64), (ticks, len(FIGURE), 1))


def cleared(poses: np.ndarray) -> np.ndarray:
    """Poses (T, J, 4) after arm clearance, tick by tick."""
    arms, figure, out = ArmClearance(FIGURE), Figure(FIGURE), poses.astype(np.float32)
    for pose in out:
        figure.set_pose(pose, np.zeros(3, dtype=np.float32))
        arms.clear(pose, figure)
    return out


def deep(poses: np.ndarray) -> float:
    """Share of the ticks with an upper arm deep in the trunk."""
    phrase = Recording(FIGURE, rest(2), np.zeros((2, 3)), 50.0)
    return BodyFigures(phrase).arms(poses.astype(np.float64)).arm_in_trunk


def test_the_trunk_is_found_by_the_joints_names() -> None:
    trunk = Trunk.of(FIGURE)
    assert trunk is not None
    assert [NAMES[joint] for joint in trunk.spine] == ["neck", "chest", "hip"]
    assert [NAMES[arm.wrist] for arm in trunk.arms] == ["lHand", "rHand"]
    assert trunk.radius_m == pytest.approx(0.2)


def test_an_arm_beside_the_trunk_is_left_alone() -> None:
    hanging = rest(50)
    hanging[:, LEFT] = quaternion.from_axis_angle([0.0, 0.0, 1.0], -1.2)
    for poses in (rest(50), hanging):
        assert np.array_equal(cleared(poses), poses.astype(np.float32))


def test_an_arm_through_the_chest_goes_around_it() -> None:
    poses = rest(100)
    poses[:, LEFT] = quaternion.slerp(quaternion.IDENTITY, ACROSS, 0.9)
    after = cleared(poses)
    assert deep(poses) == 1.0
    assert deep(after[50:]) == 0.0
    others = [joint for joint in range(len(FIGURE)) if joint not in (LEFT, ELBOW)]
    assert np.array_equal(after[:, others], poses[:, others].astype(np.float32))
    assert np.linalg.norm(after, axis=-1) == pytest.approx(1.0, abs=1e-5)


def test_a_forearm_in_the_belly_is_bent_out() -> None:
    poses = rest(100)
    poses[:, LEFT] = quaternion.from_axis_angle([0.0, 0.0, 1.0], -np.pi / 2)  # hangs
    poses[:, ELBOW] = quaternion.from_axis_angle([0.0, 0.0, 1.0], -np.pi / 2)  # to the middle
    after = cleared(poses)
    positions, _ = FIGURE.forward_kinematics(after[-1].astype(np.float64), np.zeros(3))
    hand = positions[NAMES.index("lHand")]
    assert np.hypot(hand[0], hand[2]) > 0.12  # it was 0.05 from the spine's line


def test_a_forearm_through_the_head_goes_around_it() -> None:
    trunk = Trunk.of(FIGURE)
    assert trunk is not None

    def from_the_skull(poses: np.ndarray) -> float:
        """Metres, of the forearm's middle and the wrist, whichever is nearer."""
        positions, _ = FIGURE.forward_kinematics(poses[-1].astype(np.float64), np.zeros(3))
        elbow, wrist = positions[ELBOW], positions[NAMES.index("lHand")]
        skull = positions[trunk.head] + trunk.skull
        return min(float(np.linalg.norm(place - skull)) for place in (0.5 * (elbow + wrist), wrist))

    for raised, bent in ((np.pi / 2, np.pi / 2), (1.2, 1.6), (1.0, 2.0)):
        poses = rest(100)
        poses[:, LEFT] = quaternion.from_axis_angle([0.0, 0.0, 1.0], raised)
        poses[:, ELBOW] = quaternion.from_axis_angle([0.0, 0.0, 1.0], bent)
        assert from_the_skull(poses) < 0.12
        assert from_the_skull(cleared(poses)) > 0.16


def test_an_arm_that_is_led_through_the_body_and_back_never_jumps() -> None:
    """A slow swing from one side to the other and back: the correction has a limited speed."""
    shares = np.concatenate([np.linspace(0.4, 1.2, 200), np.linspace(1.2, 0.4, 200)])
    poses = rest(400)
    poses[:, LEFT] = quaternion.from_axis_angle([0.0, 1.0, 0.0], -np.pi * shares)
    after = cleared(poses).astype(np.float64)
    assert deep(poses) > 0.2
    assert deep(after) < 0.25 * deep(poses)
    assert largest_step(after) < largest_step(poses) + 2 * 4.1  # two bones, four degrees a tick each
    assert np.abs(after[-1] - poses[-1]).max() < 1e-3  # and it comes back


def test_it_continues_from_a_state() -> None:
    poses = rest(80)
    poses[:, LEFT] = quaternion.from_axis_angle([0.0, 1.0, 0.0], -np.pi * np.linspace(0.4, 1.0, 80))
    whole = cleared(poses)
    first, second, figure = ArmClearance(FIGURE), ArmClearance(FIGURE), Figure(FIGURE)
    for tick, pose in enumerate(poses.astype(np.float32)):
        figure.set_pose(pose, np.zeros(3, dtype=np.float32))
        if tick == 40:
            restore(second, packed(first))
        (first if tick < 40 else second).clear(pose, figure)
        assert np.array_equal(pose, whole[tick])


@pytest.mark.parametrize("missing", ["head", "lShldr"])
def test_a_figure_without_these_names_is_left_alone(missing: str) -> None:
    names = tuple("thing" if name == missing else name for name in NAMES)
    assert Trunk.of(Skeleton(names, PARENTS, OFFSETS)) is None
