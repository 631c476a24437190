"""Joints held by place: the figure's frame, how a place comes and goes, its bounds, and the hips."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.dancer.grounding import Grounding, survey
from appliance.dancer.hands import HandError, Hands
from appliance.dancer.held_positions import (
    HIPS,
    HIPS_REACH_M,
    LIMBS,
    REACH,
    FixedPosition,
    HeldPosition,
    RemotePosition,
    in_figure,
    in_room,
    reach_of,
)
from appliance.dancer.loop import Placement
from appliance.dancer.puppeteers import GIVE_BACK_S, TAKE_S, FixedOrientation
from appliance.dancer.reach import LEAST_M, WIDTH, reach_in
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.standing import measure_standing
from tests.dancer.conftest import STANDING_HIP_M, random_quaternions
from tests.dancer.pulled import RIGHT, TICK_S

JOINTS = ("hip", "chest", "lShldr", "rShldr", "lFoot")
WINDOW = np.tile(quaternion.IDENTITY, (8, len(JOINTS), 1))
HERE, ROOT = (0.2, 1.35, 0.0), (0.0, STANDING_HIP_M, 0.0)
THERE = (0.3, 1.2, 0.25)  # within the reach of a shoulder


def course(
    hand: HeldPosition, seconds: float, start_s: float = 0.0, here: Sequence[float] = HERE
) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) and weights (N,) tick by tick, the root standing still."""
    places, weights = [], []
    for tick in range(round(start_s / TICK_S), round((start_s + seconds) / TICK_S)):
        hand.stand(here, ROOT, hand.given)
        weights.append(hand.pull(tick * TICK_S).weight)
        places.append(hand.position())
    return np.array(places), np.array(weights)


def fastest(places: np.ndarray) -> float:
    """Metres a second."""
    return float(np.linalg.norm(np.diff(places, axis=0), axis=-1).max()) / TICK_S


def test_the_figures_frame_is_where_the_network_sees_the_joints(skeleton: Skeleton) -> None:
    rng = np.random.default_rng(3)
    pose = random_quaternions(rng, len(skeleton)).astype(np.float64)
    root = np.array([1.5, 0.8, -2.0])
    room, _ = skeleton.forward_kinematics(pose, root)
    facing = quaternion.heading(pose[0])
    level = pose.copy()
    level[0] = quaternion.multiply(quaternion.inverse(facing), pose[0])
    seen, _ = skeleton.forward_kinematics(level, np.zeros(3))
    assert in_figure(room, root, facing) == pytest.approx(seen, abs=1e-9)
    assert in_room(seen, root, facing) == pytest.approx(room, abs=1e-9)
    assert np.abs(seen - room).max() > 0.5  # else the frame would not matter


def test_a_place_is_taken_from_where_the_joint_is_and_given_back(skeleton: Skeleton) -> None:
    hand = RemotePosition("lShldr", skeleton)
    places, weights = course(hand, 0.5)
    assert weights.max() == 0.0
    assert places == pytest.approx(np.tile(HERE, (len(places), 1)))
    hand.hold(THERE)
    places, weights = course(hand, 1.5, 0.5)
    assert places[0] == pytest.approx(HERE, abs=LIMBS.m_s2 * TICK_S**2)
    assert places[-1] == pytest.approx(THERE, abs=1e-3)
    assert weights[round(TAKE_S / TICK_S)] == pytest.approx(1.0, abs=0.01)
    assert np.diff(weights).max() < 0.07
    hand.let_go()
    places, weights = course(hand, GIVE_BACK_S + 0.1, 2.0)
    assert np.abs(np.diff(weights)).max() < 0.04
    assert weights[-1] == 0.0
    assert places[len(places) // 2] == pytest.approx(THERE, abs=1e-3)  # it fades where it was


@pytest.mark.parametrize(("joint", "limits"), [("lShldr", LIMBS), ("hip", HIPS)])
def test_a_place_that_jumps_is_followed_as_fast_as_a_dancer_moves(
    skeleton: Skeleton, joint: str, limits: tuple[float, float, float]
) -> None:
    hand = RemotePosition(joint, skeleton)
    hand.hold(HERE)
    course(hand, 1.0)
    hand.hold((-0.4, 1.0, 0.2))
    places, _ = course(hand, 2.0, 1.0)
    speeds = np.diff(places, axis=0) / TICK_S
    assert places[-1] == pytest.approx((-0.4, 1.0, 0.2), abs=0.01)
    assert 0.8 * min(limits[0], 2.0) < fastest(places) <= limits[0] + 1e-9
    assert np.linalg.norm(np.diff(speeds, axis=0), axis=-1).max() <= limits[1] * TICK_S + 1e-9
    overshot = (places - places[-1]) @ (places[-1] - places[0])
    assert overshot.max() < 0.01


def test_a_hand_that_moves_evenly_is_followed_with_a_constant_lag(skeleton: Skeleton) -> None:
    hand = RemotePosition("lShldr", skeleton)
    wanted = [(0.1 + 0.3 * math.sin(3.0 * tick * TICK_S), 1.1, 0.2) for tick in range(200)]
    found = []
    for tick, place in enumerate(wanted):
        hand.hold(place)
        found.append(course(hand, TICK_S, tick * TICK_S)[0][0])
    lag = round(LIMBS.follow_s / TICK_S)
    late = np.array(found)[100:] - np.array(wanted)[100 - lag : -lag]
    assert np.linalg.norm(late, axis=-1).max() < 0.03


def test_the_place_ahead_is_where_it_will_be(skeleton: Skeleton) -> None:
    hand = RemotePosition("lShldr", skeleton)
    for tick in range(100):
        hand.hold((0.005 * tick - 0.2, 1.2, 0.2))
        course(hand, TICK_S, tick * TICK_S)
    ahead = hand.position(2 * TICK_S)
    assert ahead[0] - hand.position()[0] == pytest.approx(0.01, abs=1e-3)


def test_a_place_out_of_reach_is_brought_within_it(skeleton: Skeleton) -> None:
    joint = skeleton.index("lShldr")
    reach = reach_of(skeleton, joint)
    assert reach == pytest.approx(REACH * (0.4 + math.hypot(0.2, 0.1)))
    hand = RemotePosition("lShldr", skeleton)
    hand.hold((30.0, 2.0, 0.0))
    places, _ = course(hand, 2.0)
    way = places[-1] - np.array(ROOT)
    assert np.linalg.norm(way) == pytest.approx(reach, abs=1e-3)
    assert way / np.linalg.norm(way) == pytest.approx([1.0, 0.0, 0.0], abs=0.05)
    hand = RemotePosition("lFoot", skeleton)
    hand.hold((0.1, -0.5, 0.0))
    assert course(hand, 2.0, here=(0.1, 0.05, 0.0))[0][-1][1] >= 0.0  # not through the floor


def test_the_hips_stay_near_their_path(skeleton: Skeleton) -> None:
    hand = RemotePosition("hip", skeleton)
    hand.hold((5.0, STANDING_HIP_M, 0.0))
    places, _ = course(hand, 4.0, here=ROOT)
    assert places[-1][0] == pytest.approx(HIPS_REACH_M, abs=1e-3)


def test_a_place_for_a_while_is_given_back_unless_it_comes_again(skeleton: Skeleton) -> None:
    hand = RemotePosition("lShldr", skeleton)
    for tick in range(50):
        hand.hold(THERE, for_s=0.5)
        _, weights = course(hand, TICK_S, tick * TICK_S)
    assert weights[-1] == pytest.approx(1.0)
    places, weights = course(hand, 2.0, 1.0)
    assert weights[round(0.4 / TICK_S)] == pytest.approx(1.0)
    assert weights[-1] == 0.0
    assert places[round(1.0 / TICK_S)] == pytest.approx(THERE, abs=0.01)


def test_a_hand_by_place_holds_where_its_joint_is_unless_it_was_told_before(skeleton: Skeleton) -> None:
    hand = RemotePosition("lShldr", skeleton)
    hand.hold_here(HERE)
    assert hand.given == HERE
    hand.hold(THERE)
    hand.hold_here(HERE)
    assert hand.given == THERE


@pytest.mark.parametrize("place", [(0, 0), (0, 0, math.nan), (0, math.inf, 0), (0, 1e3, 0)])
def test_what_is_no_place_is_refused(skeleton: Skeleton, place: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="no position"):
        FixedPosition("lShldr", skeleton, place)
    with pytest.raises(ValueError, match="no position"):
        RemotePosition("lShldr", skeleton).hold(place)


def positions_of(skeleton: Skeleton) -> np.ndarray:
    """(J, 3): of the standing figure."""
    return skeleton.forward_kinematics(skeleton.standing, np.array(ROOT))[0].astype(np.float32)


def test_hands_of_both_kinds_hold_one_figure(skeleton: Skeleton) -> None:
    fixed = FixedOrientation("chest", RIGHT)
    hands = Hands([fixed, FixedPosition("lShldr", skeleton, THERE, 0.5)], JOINTS)
    root, positions = np.array(ROOT, np.float32), positions_of(skeleton)
    for tick in range(100):
        hands.pull(tick * TICK_S, WINDOW, root, positions)
    assert hands.mask.tolist() == [False, True, False, False, False]
    assert hands.weights == pytest.approx([0, 1, 0, 0, 0])
    assert hands.place_weights == pytest.approx([0, 0, 0.5, 0, 0])
    assert hands.holds == pytest.approx([0, 1, 0.5, 0, 0])
    assert hands.places[2] == pytest.approx(np.array(THERE) - ROOT, abs=2e-3)
    assert hands.targets[:, 1] == pytest.approx(np.tile(RIGHT, (8, 1)))
    assert hands.targets[:, 2] == pytest.approx(np.tile([1, 0, 0, 0], (8, 1)))
    assert (hands.places.dtype, hands.place_weights.dtype) == (np.float32, np.float32)
    with pytest.raises(HandError, match="Two hands hold 'lShldr'"):
        Hands([FixedPosition("lShldr", skeleton, THERE), RemotePosition("lShldr", skeleton)], JOINTS)


def test_a_joint_is_held_by_orientation_and_by_place_at_once(skeleton: Skeleton) -> None:
    turned, placed = FixedOrientation("lShldr", RIGHT, 0.8), FixedPosition("lShldr", skeleton, THERE, 0.5)
    hands = Hands([turned, placed], JOINTS)
    root, positions = np.array(ROOT, np.float32), positions_of(skeleton)
    for tick in range(100):
        hands.pull(tick * TICK_S, WINDOW, root, positions)
    assert hands.by_place == (False, True)
    assert hands.weights == pytest.approx([0, 0, 0.8, 0, 0])
    assert hands.place_weights == pytest.approx([0, 0, 0.5, 0, 0])
    assert hands.holds == pytest.approx([0, 0, 0.8, 0, 0])
    assert hands.places[2] == pytest.approx(np.array(THERE) - ROOT, abs=2e-3)
    assert hands.targets[:, 2] == pytest.approx(np.tile(RIGHT, (8, 1)))


def test_where_the_puppet_stands_and_faces_is_taken_from_its_places(skeleton: Skeleton) -> None:
    placement = Placement(0.8, 2.0, -1.0)
    x, z = placement.point(THERE[0], THERE[2])
    hands = Hands([FixedPosition("lShldr", skeleton, (x, THERE[1], z))], JOINTS, placement=placement)
    facing = quaternion.from_axis_angle([0, 1, 0], 0.6)
    window = WINDOW.copy()
    window[:, 0] = facing
    root, positions = np.array(ROOT, np.float32), positions_of(skeleton)
    for tick in range(100):
        hands.pull(tick * TICK_S, window, root, positions)
    expected = in_figure(np.array(THERE), np.array(ROOT), facing)
    assert hands.places[2] == pytest.approx(expected, abs=2e-3)


def test_hands_by_place_go_on_from_their_state(skeleton: Skeleton) -> None:
    root, positions = np.array(ROOT, np.float32), positions_of(skeleton)

    def made() -> tuple[Hands, RemotePosition]:
        remote = RemotePosition("lShldr", skeleton)
        return Hands(
            [remote, FixedOrientation("chest", RIGHT), RemotePosition("hip", skeleton)], JOINTS
        ), remote

    hands, remote = made()
    remote.hold(THERE, for_s=0.3)
    for tick in range(10):
        hands.pull(tick * TICK_S, WINDOW, root, positions)
    other, _ = made()
    restore(other, packed(hands))
    for tick in range(10, 60):
        for each in (hands, other):
            each.pull(tick * TICK_S, WINDOW, root, positions)
        assert other.places.tobytes() == hands.places.tobytes()
        assert other.place_weights.tobytes() == hands.place_weights.tobytes()
        assert other.holds.tobytes() == hands.holds.tobytes()
    assert hands.place_weights[2] < 0.5  # it was let go meanwhile


def danced(swaying: Recording, released_at: int) -> tuple[np.ndarray, np.ndarray]:
    """Roots (N, 3) and poses (N, J, 4), grounded, with the hips held from the start until a tick."""
    skeleton, floor = swaying.skeleton, survey(swaying)
    grounding, hand = Grounding(skeleton, floor), RemotePosition("hip", skeleton)
    hands = Hands([hand], ("hip", "chest"))
    if released_at:
        hand.hold((0.5, STANDING_HIP_M, 0.1))
    holds = np.zeros(len(skeleton), np.float32)
    roots, poses = [], []
    for tick in range(600):
        at = tick % len(swaying)
        pose, root = swaying.poses[at].astype(np.float32), swaying.roots[at].astype(np.float32)
        if tick == released_at:
            hand.let_go()
        hands.pull(tick * TICK_S, WINDOW[:, :2], root + grounding.shift, grounding.figure.positions)
        assert not hands.place_weights.any()  # the network has nothing to do with it
        grounding.draw_hips(*hands.hips_drawn)
        grounding.ground_pose(pose, root, float(floor.lifts[at]), held=holds)
        roots.append(grounding.root.copy())
        poses.append(grounding.pose.copy())
    return np.array(roots), np.array(poses)


def test_hips_that_a_hand_draws_leave_the_feet_on_the_floor(swaying: Recording) -> None:
    (found, poses), (free, _) = danced(swaying, 300), danced(swaying, 0)
    assert found[200:300, [0, 2]] == pytest.approx(np.tile((0.5, 0.1), (100, 1)), abs=0.03)
    assert np.abs(free[200:300, 0] - 0.5).min() > 0.2  # else it would not have been drawn
    assert found[-1] == pytest.approx(free[-1], abs=1e-3)
    assert fastest(found[:, [0, 2]]) < 1.2
    steps = np.diff(found[:, [0, 2]], axis=0)
    assert np.linalg.norm(np.diff(steps, axis=0), axis=-1).max() < 0.006  # its speed does not jump
    floor = survey(swaying)
    stood = measure_standing(swaying.skeleton, poses, found, floor, np.zeros(len(found)))
    assert max(stood.float_cm, stood.penetration_cm) < 0.5
    assert stood.slide_cm_s < 10.0


def test_the_places_of_a_phrase_are_within_reach_wherever_it_faces(swaying: Recording) -> None:
    skeleton = swaying.skeleton
    joint = skeleton.index("lShldr")
    turned = swaying.poses.copy()
    turned[:, 0] = quaternion.multiply(quaternion.from_axis_angle([0, 1, 0], 2.0), turned[:, 0])
    reach, again = (reach_in([poses], skeleton, joint) for poses in (swaying.poses, turned))
    assert again.middle == pytest.approx(reach.middle, abs=1e-5)
    assert again.axes == pytest.approx(reach.axes, abs=1e-5)
    places = skeleton.forward_kinematics(swaying.poses, np.zeros(3))[0][:, joint].astype(np.float32)
    for place in places[::7]:
        assert reach.bounded(place) == pytest.approx(place)


def test_a_place_outside_is_brought_in_and_never_jumps(swaying: Recording) -> None:
    reach = reach_in([swaying.poses], swaying.skeleton, swaying.skeleton.index("lShldr"))
    far = reach.middle + np.array((0, 0, 5), np.float32)
    near = reach.bounded(far)
    assert np.linalg.norm(np.linalg.solve(reach.axes, near - reach.middle)) == pytest.approx(1.0, abs=1e-4)
    assert WIDTH * LEAST_M - 1e-3 < np.linalg.norm(near - reach.middle) < 0.6
    angles = np.linspace(0, np.pi, 200)
    around = [np.array((np.sin(a), 0.3, np.cos(a)), np.float32) for a in angles]
    course = np.array([reach.bounded(reach.middle + place) for place in around])
    asked = np.linalg.norm(np.diff(around, axis=0), axis=1).max()
    assert np.linalg.norm(np.diff(course, axis=0), axis=1).max() < 1.5 * asked
