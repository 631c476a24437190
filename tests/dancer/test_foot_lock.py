"""Feet that carry the figure stay where they are, their legs reach there, and nothing else moves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from appliance.box.snapshot import packed, restore, unpacked
from appliance.dancer import two_bones
from appliance.dancer.foot_lock import FootLock
from appliance.dancer.grounding import Grounding, sole_positions, survey
from appliance.dancer.two_bones import Vector
from appliance.pose import quaternion, turns
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.evaluation.dance_figures import largest_step, roughness
from appliance.studio.standing import measure_standing
from tests.dancer.test_grounding import LEGS, with_legs_moved

coordinates = st.floats(-1, 1, allow_nan=False, width=32)
vectors = st.tuples(coordinates, coordinates, coordinates)
LEFT, RIGHT = LEGS[:3], LEGS[3:]


class Stood(NamedTuple):
    """Poses (T, J, 4) as they left grounding, and roots (T, 3)."""

    poses: np.ndarray
    roots: np.ndarray


@pytest.fixture(scope="module")
def crouching(skeleton: Skeleton) -> Recording:
    """Four seconds with bent knees, the hip swaying by 5 cm over feet that do not move."""
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (200, len(skeleton), 1))
    for side in "lr":
        for bone, radians in (("Thigh", -0.5), ("Shin", 1.0), ("Foot", -0.5)):
            poses[:, skeleton.index(side + bone)] = quaternion.from_axis_angle([1, 0, 0], radians)
    turn = 2 * np.pi * np.arange(200) / 200
    roots = np.stack([0.05 * np.cos(turn), np.full(200, 0.75), 0.05 * np.sin(turn)], axis=1)
    return Recording(skeleton, poses, roots, 50.0)


def stand(phrase: Recording, poses: np.ndarray, held: np.ndarray | None) -> Stood:
    """Grounding over all ticks; held: (J,) or (T, J) weights, or None: no lock."""
    floor = survey(phrase)
    grounding = Grounding(phrase.skeleton, floor)
    rows = []
    for tick, pose in enumerate(poses.astype(np.float32)):
        weights = held if held is None or held.ndim == 1 else held[tick]
        root = phrase.roots[tick].astype(np.float32)
        grounding.ground_pose(pose, root, float(floor.lifts[tick]), held=weights)
        rows.append((grounding.pose.copy(), grounding.root.copy()))
    return Stood(*(np.array(column) for column in zip(*rows, strict=True)))


def nobody(skeleton: Skeleton, *names: str) -> np.ndarray:
    """Weights (J,): 1 for these joints."""
    return np.array([name in names for name in skeleton.names], dtype=np.float32)


def slide(phrase: Recording, stood: Stood) -> float:
    floor = survey(phrase)
    return measure_standing(phrase.skeleton, *stood, floor, floor.lifts).slide_cm_s


@given(vectors, vectors, vectors, vectors, vectors)
def test_a_bent_chain_keeps_its_bones_and_reaches_its_target(
    root: Vector, middle: Vector, end: Vector, target: Vector, towards: Vector
) -> None:
    upper, lower = math.dist(root, middle), math.dist(middle, end)
    assume(min(upper, lower, math.dist(root, target), math.dist(root, end)) > 0.05)
    assume(math.dist(root, target) > abs(upper - lower) + 0.01)
    bent, reached = two_bones.bend(root, middle, end, target, towards)
    assert math.dist(root, bent) == pytest.approx(upper, abs=1e-6)
    assert math.dist(bent, reached) == pytest.approx(lower, abs=1e-6)
    if math.dist(root, target) < 0.99 * (upper + lower):
        assert reached == pytest.approx(target, abs=1e-6)


@given(vectors, vectors)
def test_the_shortest_turn_turns_one_direction_into_the_other(a: Vector, b: Vector) -> None:
    assume(min(two_bones.norm(a), two_bones.norm(b)) > 0.01)
    assume(turns.dot(a, b) > -0.999 * two_bones.norm(a) * two_bones.norm(b))
    turned = two_bones.rotate(two_bones.between(a, b), a)
    wanted = two_bones.scale(b, two_bones.norm(a) / two_bones.norm(b))
    assert turned == pytest.approx(wanted, abs=1e-6)


def test_feet_that_the_puppet_drags_stand_still(crouching: Recording) -> None:
    poses = with_legs_moved(crouching, 0.2)
    free, locked = stand(crouching, poses, None), stand(crouching, poses, nobody(crouching.skeleton))
    assert slide(crouching, free) > 8.0
    assert slide(crouching, locked) < 0.4 * slide(crouching, free)
    legs = [crouching.skeleton.index(name) for name in LEGS]
    assert roughness(locked.poses[:, legs]) < 0.6  # degrees a tick squared; a dancer's legs: 2
    assert largest_step(locked.poses[:, legs]) < 2.0 * largest_step(poses[:, legs])


def test_only_legs_turn_and_feet_keep_their_orientation(crouching: Recording) -> None:
    skeleton, poses = crouching.skeleton, with_legs_moved(crouching, 0.2)
    locked = stand(crouching, poses, nobody(skeleton))
    others = [joint for joint, name in enumerate(skeleton.names) if name not in LEGS]
    assert np.array_equal(locked.poses[:, others], poses[:, others].astype(np.float32))
    assert np.linalg.norm(locked.poses, axis=-1) == pytest.approx(1.0, abs=1e-5)
    _, before = skeleton.forward_kinematics(poses, crouching.roots)
    _, after = skeleton.forward_kinematics(locked.poses, locked.roots)
    feet = list(skeleton.feet)
    assert quaternion.angle_between(before[:, feet], after[:, feet]).max() < 1e-3


def test_the_figure_shows_what_the_pose_says(crouching: Recording) -> None:
    """The lock moves joints of the figure by itself: forward kinematics would cost as much again."""
    skeleton, floor = crouching.skeleton, survey(crouching)
    grounding, held = Grounding(skeleton, floor), nobody(skeleton)
    for tick, pose in enumerate(with_legs_moved(crouching, 0.2).astype(np.float32)):
        figure = grounding.ground_pose(pose, crouching.roots[tick].astype(np.float32), 0.0, held=held)
        positions, world = skeleton.forward_kinematics(
            grounding.pose.astype(float), grounding.root.astype(float)
        )
        soles = sole_positions(skeleton, grounding.pose[None].astype(float), grounding.root[None])[0]
        assert np.abs(figure.positions - positions).max() < 1e-5
        assert quaternion.angle_between(figure.world.astype(float), world).max() < 1e-3
        assert np.abs(figure.soles - soles).max() < 1e-5


def test_without_the_lock_legs_are_left_as_they_are(crouching: Recording) -> None:
    poses = with_legs_moved(crouching, 0.2)
    assert np.array_equal(stand(crouching, poses, None).poses, poses.astype(np.float32))


@pytest.mark.parametrize("joint", LEFT)
def test_a_leg_that_a_hand_holds_is_left_alone(crouching: Recording, joint: str) -> None:
    skeleton, poses = crouching.skeleton, with_legs_moved(crouching, 0.2)
    locked = stand(crouching, poses, nobody(skeleton, joint))
    left, right = ([skeleton.index(name) for name in side] for side in (LEFT, RIGHT))
    assert np.array_equal(locked.poses[:, left], poses[:, left].astype(np.float32))
    assert not np.allclose(locked.poses[:, right], poses[:, right], atol=1e-3)


def test_a_leg_that_is_taken_goes_where_the_hand_wants_it_without_a_jump(crouching: Recording) -> None:
    skeleton, poses = crouching.skeleton, with_legs_moved(crouching, 0.2)
    held = np.zeros((len(poses), len(skeleton)), dtype=np.float32)
    held[100:, skeleton.index("lThigh")] = np.minimum(1.0, np.arange(1, len(poses) - 99) / 25)
    locked = stand(crouching, poses, held)
    left = [skeleton.index(name) for name in LEFT]
    assert np.abs(locked.poses[90:100, left] - poses[90:100, left]).max() > 0.005
    assert np.array_equal(locked.poses[180:, left], poses[180:, left].astype(np.float32))
    assert largest_step(locked.poses[:, left]) < 2.0 * largest_step(poses[:, left])


def test_it_continues_from_a_state(crouching: Recording) -> None:
    poses, floor = with_legs_moved(crouching, 0.2).astype(np.float32), survey(crouching)
    held, roots = nobody(crouching.skeleton), crouching.roots.astype(np.float32)
    first, second = Grounding(crouching.skeleton, floor), Grounding(crouching.skeleton, floor)
    for tick in range(60):
        first.ground_pose(poses[tick], roots[tick], 0.0, held=held)
    restore(second, packed(first))
    for tick in range(60, 120):
        for grounding in (first, second):
            grounding.ground_pose(poses[tick], roots[tick], 0.0, held=held)
        assert np.array_equal(first.pose, second.pose)
        assert np.array_equal(first.root, second.root)


def test_a_figure_without_legs_of_two_bones_is_not_locked(crouching: Recording) -> None:
    """Feet straight on the hip: nothing could make up for their slide."""
    names, parents = ("hip", "lFoot", "rFoot"), (-1, 0, 0)
    stumps = Skeleton(names, parents, np.array([[0, 0, 0], [0.1, -0.8, 0], [-0.1, -0.8, 0]]))
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (50, 3, 1))
    poses[:, 1] = quaternion.from_axis_angle([1, 0, 0], np.sin(np.arange(50) / 5))
    phrase = Recording(stumps, poses, crouching.roots[:50], 50.0)
    assert np.array_equal(stand(phrase, poses, nobody(stumps)).poses, poses.astype(np.float32))
    assert unpacked(packed(FootLock(stumps)))["_legs"] == []
