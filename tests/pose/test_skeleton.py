"""Forward kinematics against a plain matrix walk down the tree; names with their nearest right one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton, UnknownJointError


def matrix_of(w: float, x: float, y: float, z: float) -> list[list[float]]:
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def walk(parents, offsets, pose, root):
    """The textbook: 4x4 transforms multiplied from the root to each joint, one joint at a time."""
    transforms: list[np.ndarray] = []
    for joint, parent in enumerate(parents):
        local = np.eye(4)
        local[:3, :3] = matrix_of(*pose[joint])
        local[:3, 3] = root if parent < 0 else offsets[joint]
        transforms.append(local if parent < 0 else transforms[parent] @ local)
    return np.array([t[:3, 3] for t in transforms]), np.array([t[:3, :3] for t in transforms])


def random_skeleton(generator: np.random.Generator, joints: int) -> Skeleton:
    parents = (-1, *(int(generator.integers(0, j)) for j in range(1, joints)))
    return Skeleton(tuple(f"j{i}" for i in range(joints)), parents, generator.normal(size=(joints, 3)))


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
@settings(max_examples=50, deadline=None)
def test_forward_kinematics_agrees_with_the_textbook(seed: int, joints: int) -> None:
    generator = np.random.default_rng(seed)
    skeleton = random_skeleton(generator, joints)
    poses = quaternion.normalize(generator.normal(size=(2, 3, joints, 4)))
    roots = generator.normal(size=(2, 3, 3))
    positions, world = skeleton.forward_kinematics(poses, roots)
    for index in np.ndindex(2, 3):
        expected, turned = walk(skeleton.parents, skeleton.offsets, poses[index], roots[index])
        np.testing.assert_allclose(positions[index], expected, atol=1e-9)
        np.testing.assert_allclose(quaternion.to_matrix(world[index]), turned, atol=1e-9)


def test_an_arm_turned_a_quarter_points_up() -> None:
    arm = Skeleton(
        ("shoulder", "elbow", "wrist"), (-1, 0, 1), np.array([[0, 0, 0], [0.3, 0, 0], [0.25, 0, 0]])
    )
    pose = np.tile(quaternion.IDENTITY.astype(float), (3, 1))
    pose[0] = quaternion.from_axis_angle([0, 0, 1], math.pi / 2)
    positions, _ = arm.forward_kinematics(pose, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(positions, [[1, 2, 3], [1, 2.3, 3], [1, 2.55, 3]], atol=1e-12)


def test_the_offset_of_the_root_takes_no_part() -> None:
    skeleton = Skeleton(("hip",), (-1,), np.array([[5.0, 5.0, 5.0]]))
    positions, _ = skeleton.forward_kinematics(quaternion.IDENTITY[None], np.zeros(3, np.float32))
    np.testing.assert_array_equal(positions, [[0, 0, 0]])


def test_translations_replace_the_offsets() -> None:
    skeleton = random_skeleton(np.random.default_rng(3), 6)
    pose = np.tile(quaternion.IDENTITY.astype(float), (4, 6, 1))
    translations = np.random.default_rng(4).normal(size=(4, 6, 3))
    positions, _ = skeleton.forward_kinematics(pose, np.zeros((4, 3)), translations)
    for joint, parent in enumerate(skeleton.parents[1:], start=1):
        np.testing.assert_allclose(positions[:, joint] - positions[:, parent], translations[:, joint])


def test_a_tick_stays_float32() -> None:
    skeleton = random_skeleton(np.random.default_rng(5), 9)
    pose = np.tile(quaternion.IDENTITY, (9, 1))
    positions, world = skeleton.forward_kinematics(pose, np.zeros(3, dtype=np.float32))
    assert positions.dtype == world.dtype == np.float32
    assert world is not pose


def test_a_wrong_name_is_told_the_nearest_right_one() -> None:
    names = ("hip", "lShldr", "rShldr", "lForeArm")
    skeleton = Skeleton(names, (-1, 0, 0, 1), np.zeros((4, 3)))
    assert [skeleton.index(name) for name in names] == [0, 1, 2, 3]
    with pytest.raises(UnknownJointError, match=r"no joint 'LSHLDR'. Did you mean 'lShldr'\?") as caught:
        skeleton.index("LSHLDR")
    assert caught.value.nearest == "lShldr"
    with pytest.raises(UnknownJointError, match=r"no joint 'xylophone'\.$") as caught:
        skeleton.index("xylophone")
    assert caught.value.nearest is None


def test_feet_are_found_by_name() -> None:
    names = ("hip", "rThigh", "rFoot", "LeftAnkle", "LeftToes")
    assert Skeleton(names, (-1, 0, 1, 0, 3), np.zeros((5, 3))).feet == (2, 3)


def test_same_joints_means_same_names_and_parents() -> None:
    one = Skeleton(("a", "b", "c"), (-1, 0, 1), np.zeros((3, 3)))
    assert one.same_joints(Skeleton(("a", "b", "c"), (-1, 0, 1), np.ones((3, 3))))
    assert not one.same_joints(Skeleton(("a", "b", "c"), (-1, 0, 0), np.zeros((3, 3))))
    assert not one.same_joints(Skeleton(("a", "c", "b"), (-1, 0, 1), np.zeros((3, 3))))
