"""The figure stands on the floor, jumps when the phrase jumps, and does not slide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.dancer.grounding import (
    Grounding,
    GroundingError,
    sole_positions,
    survey,
)
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.standing import Standing, measure_standing
from tests.dancer.conftest import STANDING_HIP_M

LEGS = ("lThigh", "lShin", "lFoot", "rThigh", "rShin", "rFoot")


def grounded(phrase: Recording, poses: np.ndarray, on_floor: bool = True) -> np.ndarray:
    """Roots (N, 3) of poses that a puppet made of a phrase, grounded tick by tick."""
    floor = survey(phrase)
    grounding = Grounding(phrase.skeleton, floor if on_floor else None)
    roots = []
    for pose, root, lift in zip(poses, phrase.roots, floor.lifts, strict=True):
        grounding.ground_pose(pose.astype(np.float32), root.astype(np.float32), float(lift))
        roots.append(grounding.root.copy())
    return np.array(roots)


def standing(phrase: Recording, poses: np.ndarray, roots: np.ndarray) -> Standing:
    floor = survey(phrase)
    return measure_standing(phrase.skeleton, poses, roots, floor, floor.lifts)


def with_legs_moved(phrase: Recording, radians: float, seed: int = 0) -> np.ndarray:
    """The phrase's poses with every leg joint swinging by so much: what a careless puppet would do."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(len(phrase)) / 50
    poses = phrase.poses.copy()
    for name in LEGS:
        joint = phrase.skeleton.index(name)
        angle = radians * np.sin(2 * np.pi * rng.uniform(0.4, 1.1) * time_s + rng.uniform(0, 6))
        turn = quaternion.from_axis_angle(rng.normal(size=3), angle)
        poses[:, joint] = quaternion.multiply(turn, poses[:, joint])
    return poses


@pytest.fixture(scope="module")
def hopping(skeleton: Skeleton) -> Recording:
    """Stands for a second, jumps 30 cm high, stands again, three times; the feet wander by a centimetre."""
    time_s = np.arange(300) / 50
    height = 0.3 * np.abs(np.sin(np.pi * time_s)) * (np.floor(time_s) % 2)
    noise = 0.01 * np.sin(7 * time_s)
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (300, len(skeleton), 1))
    roots = np.stack([0 * time_s, STANDING_HIP_M + height + noise, 0 * time_s], axis=1)
    return Recording(skeleton, poses, roots, 50.0)


def test_the_survey_learns_the_soles_heights_and_the_jumps(hopping: Recording) -> None:
    floor = survey(hopping)
    assert floor.rest_heights == pytest.approx([0.05, 0.0, 0.05, 0.0], abs=0.012)
    in_air = hopping.roots[:, 1] - STANDING_HIP_M
    assert (floor.lifts[in_air < 0.015] == 0.0).all()
    assert floor.lifts[in_air > 0.1] == pytest.approx(in_air[in_air > 0.1], abs=0.02)


def test_standing_feet_are_on_the_floor_and_jumps_keep_their_height(hopping: Recording) -> None:
    roots = grounded(hopping, hopping.poses)
    after = standing(hopping, hopping.poses, roots)
    assert max(after.worst_float_cm, after.worst_penetration_cm) < 1.0
    assert roots[:, 1].max() - roots[:, 1].min() == pytest.approx(0.3, abs=0.03)
    still = (survey(hopping).lifts == 0) & (np.arange(300) > 20)
    assert np.ptp(roots[still & (np.arange(300) < 50), 1]) < 0.003  # the wander is gone


def test_bent_legs_sink_to_the_floor(hopping: Recording) -> None:
    """Thighs forward, shins back: the feet would hang in the air."""
    skeleton = hopping.skeleton
    poses = hopping.poses.copy()
    for side in "lr":
        poses[:, skeleton.index(f"{side}Thigh")] = quaternion.from_axis_angle([1, 0, 0], -0.8)
        poses[:, skeleton.index(f"{side}Shin")] = quaternion.from_axis_angle([1, 0, 0], 1.6)
        poses[:, skeleton.index(f"{side}Foot")] = quaternion.from_axis_angle([1, 0, 0], -0.8)
    before = standing(hopping, poses, hopping.roots)
    roots = grounded(hopping, poses)
    after = standing(hopping, poses, roots)
    assert before.float_cm > 20
    assert after.float_cm < 0.2
    assert after.penetration_cm < 0.2
    assert np.mean(hopping.roots[:40, 1] - roots[:40, 1]) == pytest.approx(0.8 * (1 - np.cos(0.8)), abs=0.02)


def test_a_stretched_leg_is_not_pushed_through_the_floor(hopping: Recording) -> None:
    """Standing on tiptoe with one foot: the figure rises."""
    poses = hopping.poses.copy()
    poses[:, hopping.skeleton.index("lFoot")] = quaternion.from_axis_angle([1, 0, 0], 0.7)
    before = standing(hopping, poses, hopping.roots)
    after = standing(hopping, poses, grounded(hopping, poses))
    assert before.penetration_cm > 5
    assert after.penetration_cm < 0.2


def test_a_planted_foot_is_pinned_while_the_legs_swing(swaying: Recording) -> None:
    """The hip circles over feet that the phrase drags along; the puppet's legs swing as well."""
    poses = with_legs_moved(swaying, 0.2)
    before, after = (
        standing(swaying, poses, swaying.roots),
        standing(swaying, poses, grounded(swaying, poses)),
    )
    assert before.slide_cm_s > 25
    assert after.slide_cm_s < before.slide_cm_s / 2.5
    assert after.float_cm < 0.1
    assert after.penetration_cm < 0.1


def test_the_root_goes_back_to_its_path(hopping: Recording) -> None:
    """After the puppet's legs have carried the figure away it returns within seconds, slowly."""
    swinging = with_legs_moved(hopping, 0.3)
    phrase = Recording(
        hopping.skeleton, np.tile(hopping.poses, (3, 1, 1)), np.tile(hopping.roots, (3, 1)), 50.0
    )
    phrase.roots[300:, 1] = STANDING_HIP_M
    poses = phrase.poses.copy()
    poses[:300] = swinging
    away = np.linalg.norm((grounded(phrase, poses) - phrase.roots)[:, [0, 2]], axis=1)
    assert away[290:330].max() > 0.02
    assert away[-1] < 0.15 * away[330]  # after 23 s
    assert np.abs(np.diff(away[330:])).max() < 0.005


def test_nothing_pops(walking: Recording) -> None:
    """From tick to tick the grounded hip never moves much faster than the legs can explain."""
    poses = with_legs_moved(walking, 0.15)
    roots = grounded(walking, poses)
    feet = sole_positions(walking.skeleton, poses, walking.roots)
    fastest_foot = np.linalg.norm(np.diff(feet, axis=0), axis=-1).max()
    assert np.linalg.norm(np.diff(roots, axis=0), axis=1).max() < 1.5 * fastest_foot


def test_without_a_floor_the_figure_stays_where_the_phrase_has_it(walking: Recording) -> None:
    roots = grounded(walking, walking.poses, on_floor=False)
    assert np.allclose(roots, walking.roots, atol=1e-6)


def test_a_foot_that_never_stands_is_not_taken_for_a_planted_one(skeleton: Skeleton) -> None:
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (100, len(skeleton), 1))
    poses[:, skeleton.index("lThigh")] = quaternion.from_axis_angle([1, 0, 0], -1.0)
    roots = np.tile([0.0, STANDING_HIP_M, 0.0], (100, 1))
    rest = survey(Recording(skeleton, poses, roots, 50.0)).rest_heights
    assert rest[2:] == pytest.approx([0.05, 0.0], abs=1e-6)
    assert rest[:2].max() < 0.09


def test_a_skeleton_without_feet_is_refused_with_the_cure() -> None:
    skeleton = Skeleton(("hip", "paw"), (-1, 0), np.array([[0, 0, 0], [0, -1, 0]]))
    phrase = Recording(skeleton, np.tile([1.0, 0, 0, 0], (20, 2, 1)), np.ones((20, 3)), 50.0)
    with pytest.raises(GroundingError, match="grounded: false"):
        survey(phrase)


def test_the_measure_sees_what_is_wrong(hopping: Recording) -> None:
    """Known errors come out as they went in."""
    floor = survey(hopping)
    still = np.tile(hopping.poses[:1], (50, 1, 1))
    soles = sole_positions(hopping.skeleton, still, np.tile([0.0, STANDING_HIP_M, 0.0], (50, 1)))
    rise = -(soles[0, :, 1] - floor.rest_heights).min()
    up = np.tile([0.0, STANDING_HIP_M + rise + 0.03, 0.0], (50, 1))
    up[:, 0] = np.arange(50) * 0.004
    found = measure_standing(hopping.skeleton, still, up, floor)
    assert found.float_cm == pytest.approx(3.0, abs=1e-3)
    assert found.penetration_cm == 0.0
    assert found.slide_cm_s == pytest.approx(20.0, rel=1e-3)
    up[:, 1] -= 0.05
    assert measure_standing(hopping.skeleton, still, up, floor).worst_penetration_cm == pytest.approx(
        2.0, abs=1e-3
    )


@pytest.mark.parametrize(("file", "true_fps"), [("salsa_25", 60), ("indian_13", 120)])
def test_recordings_stand_better_than_they_were_captured(
    recordings_dir: Path, file: str, true_fps: float
) -> None:
    phrase = read_bvh(recordings_dir / "train" / f"{file}.bvh", true_fps=true_fps, drop_tpose=True)
    phrase = phrase.resampled(50.0)
    for radians in (0.0, 0.15):
        poses = with_legs_moved(phrase, radians)
        before = standing(phrase, poses, phrase.roots)
        after = standing(phrase, poses, grounded(phrase, poses))
        assert after.float_cm + after.penetration_cm < 0.1
        assert max(after.worst_float_cm, after.worst_penetration_cm) < 1.0
        assert after.slide_cm_s < 15.0
        assert after.slide_cm_s < 0.5 * before.slide_cm_s


@pytest.mark.parametrize("jump", [[40.0, 0.0, 0.0], [0.0, 60.0, 0.0], [-17.5, 0.0, 900.0]])
@pytest.mark.parametrize("back_after", [1, 5, 1000])
def test_a_root_that_jumps_moves_the_figure_for_a_moment_only(
    hopping: Recording, jump: list[float], back_after: int
) -> None:
    """An offset of 17 m once grew with each tick until no float held it."""
    floor = survey(hopping)
    grounding, root = Grounding(hopping.skeleton, floor), np.array([0.0, STANDING_HIP_M, 0.0])
    for tick in range(400):
        here = root + np.array(jump) * (50 <= tick < 50 + back_after)
        grounding.ground_pose(hopping.poses[0].astype(np.float32), here.astype(np.float32), 0.0)
        strayed = grounding.root - here.astype(np.float32)
        assert np.isfinite(grounding.figure.positions).all()
        assert np.hypot(strayed[0], strayed[2]) < 1.1 * np.linalg.norm(jump), tick
    assert np.hypot(*grounding.strayed) < 2.0


def test_a_grounding_that_begins_anew_stands_on_the_path(hopping: Recording) -> None:
    grounding, fresh = (Grounding(hopping.skeleton, survey(hopping)) for _ in range(2))
    grounding.strayed = 1e200, -1e200
    pose, root = hopping.poses[0].astype(np.float32), hopping.roots[0].astype(np.float32)
    with np.errstate(all="ignore"), pytest.raises(OverflowError):
        for _ in range(3):
            grounding.ground_pose(pose, root, 0.0)
    grounding.begin_anew()
    for _ in range(5):
        grounding.ground_pose(pose, root, 0.0)
        fresh.ground_pose(pose, root, 0.0)
    assert np.array_equal(grounding.figure.positions, fresh.figure.positions)
