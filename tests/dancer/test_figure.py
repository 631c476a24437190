"""The figure of the tick stands exactly where forward kinematics says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.dancer.forward_kinematics import Figure, soles_of
from appliance.dancer.grounding import sole_positions
from appliance.dancer.slerp import Slerp
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.skeleton import Skeleton
from tests.dancer.conftest import random_quaternions


def check(skeleton: Skeleton, seed: int) -> None:
    rng = np.random.default_rng(seed)
    figure = Figure(skeleton)
    for _ in range(3):  # what the pose before left behind must not show
        pose = random_quaternions(rng, len(skeleton))
        root = rng.normal(size=3).astype(np.float32)
        figure.set_pose(pose, root)
        positions, world = skeleton.forward_kinematics(pose.astype(np.float64), root.astype(np.float64))
        assert np.abs(figure.positions - positions).max() < 1e-5
        assert np.abs(figure.world - world).max() < 1e-5
        soles = sole_positions(skeleton, pose[None].astype(np.float64), root[None].astype(np.float64))[0]
        assert np.abs(figure.soles - soles).max() < 1e-5
        figure.move(np.array([1.0, 2.0, 3.0], dtype=np.float32))
        assert np.abs(figure.positions - positions - [1, 2, 3]).max() < 1e-5
        assert np.abs(figure.soles - soles - [1, 2, 3]).max() < 1e-5


@st.composite
def skeletons(draw: st.DrawFn) -> Skeleton:
    """Any tree of up to 20 joints, some of them feet."""
    count = draw(st.integers(1, 20))
    parents = [-1] + [draw(st.integers(0, joint - 1)) for joint in range(1, count)]
    names = [f"joint{k}" + draw(st.sampled_from(["", "", "", "Foot", "Ankle"])) for k in range(count)]
    offsets = np.random.default_rng(count).normal(size=(count, 3))
    offsets[0] = 0
    leaves = [joint for joint in range(count) if joint not in parents]
    ends = tuple((joint, (0.1, -0.2, 0.3)) for joint in leaves)
    return Skeleton((*names[:-1], names[-1] + "Foot"), tuple(parents), offsets, ends)


@given(skeletons(), st.integers(0, 1000))
def test_agrees_with_the_skeleton_for_any_tree(skeleton: Skeleton, seed: int) -> None:
    check(skeleton, seed)


def test_agrees_with_the_skeleton_of_a_recording(recordings_dir: Path) -> None:
    recording = read_bvh(recordings_dir / "train" / "indian_13.bvh", drop_tpose=True)
    check(recording.skeleton, 1)
    assert [recording.skeleton.names[foot[0]] for foot in soles_of(recording.skeleton)] == ["rFoot", "lFoot"]


def test_the_soles_are_the_foot_and_its_end(skeleton: Skeleton) -> None:
    assert soles_of(skeleton) == ((6, 11), (9, 13))


@pytest.mark.parametrize("name", ["spine", "leg"])
def test_a_figure_without_feet_has_no_soles(name: str) -> None:
    figure = Figure(Skeleton((name,), (-1,), np.zeros((1, 3))))
    figure.set_pose(np.array([[1, 0, 0, 0]], dtype=np.float32), np.ones(3, dtype=np.float32))
    assert figure.soles.shape == (0, 3)
    assert figure.positions.tolist() == [[1, 1, 1]]


@given(st.integers(0, 2**32 - 1))
def test_agrees_with_the_poses_slerp_for_any_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_quaternions(rng, 2, 50)
    b[:10] = a[:10]
    b[10:20] = -a[10:20]
    b[20:30] = quaternion.normalize(a[20:30] + 1e-4 * b[20:30])
    t = rng.uniform(0, 1, 50).astype(np.float32)
    out = np.empty((50, 4), dtype=np.float32)
    Slerp(50)(a, b, t, out)
    expected = quaternion.slerp(a.astype(np.float64), b.astype(np.float64), t)
    assert np.abs(out - expected).max() < 2e-6


def test_ends_are_exact_and_lie_in_the_first_ones_hemisphere() -> None:
    a, b = random_quaternions(np.random.default_rng(1), 2, 40)
    out = np.empty_like(a)
    Slerp(40)(a, b, 0.0, out)
    assert np.allclose(out, a, atol=1e-7)
    Slerp(40)(a, b, 1.0, out)
    assert np.allclose(out, quaternion.aligned(b, a), atol=1e-7)


def test_may_write_into_its_first_argument() -> None:
    a, b = random_quaternions(np.random.default_rng(2), 2, 40)
    expected = quaternion.slerp(a, b, np.float32(0.3))
    Slerp(40)(a, b, 0.3, a)
    assert np.allclose(a, expected, atol=1e-6)
