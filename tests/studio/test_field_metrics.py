"""Figures that the field uses, on motions whose figures are known; limbs, matching and coverage."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from appliance.pose import quaternion
from appliance.studio.data.dataset import Take
from appliance.studio.evaluation.coverage import RecordedMotion
from appliance.studio.evaluation.critic import area_under_curve
from appliance.studio.evaluation.field_metrics import foot_skate_ratio, jerk, physical_foot_contact
from appliance.studio.evaluation.limbs import limbs_of, spread
from appliance.studio.evaluation.matching import FADE_TICKS, MotionMatching
from appliance.studio.evaluation.motion_features import (
    clips_of,
    frechet_distance,
    geometric_features,
    kinetic_features,
)
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import UNDER, naturalness_table
from tests.studio.dancers import ARM, danced, motions
from tests.studio.puppets import NAMES
from tests.studio.tiny import moving, swaying

PLACES = list(moving())


def test_the_area_under_the_curve_counts_ties_half() -> None:
    assert area_under_curve(np.array([0.0, 1.0]), np.array([2.0, 3.0])) == 1.0
    assert area_under_curve(np.array([2.0, 3.0]), np.array([0.0, 1.0])) == 0.0
    assert area_under_curve(np.array([1.0, 1.0]), np.array([1.0, 1.0])) == 0.5
    assert area_under_curve(np.array([0.0, 2.0]), np.array([1.0, 3.0])) == 0.75


def test_limbs_are_told_by_name_and_the_held_limb_is_apart() -> None:
    named = {limb: [NAMES[place] for place in places] for limb, places in limbs_of(NAMES, ARM).items()}
    assert named["legs"] == ["rThigh", "rShin", "rFoot", "lThigh", "lShin", "lFoot"]
    assert named["trunk"] == ["hip", "abdomen", "chest", "neck", "head"]
    assert named["arms"] == ["rShldr", "rForeArm", "rHand"] and named["held_limb"] == ["lForeArm", "lHand"]
    assert "held_limb" not in limbs_of(NAMES, "head") and len(limbs_of(NAMES, "head")["trunk"]) == 4
    thigh = limbs_of(NAMES, "lThigh")
    assert len(thigh["legs"]) == 3 and len(thigh["arms"]) == 6 and len(thigh["held_limb"]) == 2
    assert limbs_of(["bone_1", "bone_2"]) == {}


def test_spread_is_the_deviation_of_the_orientations() -> None:
    angles = 0.3 * np.sqrt(2) * np.sin(np.linspace(0, 20 * np.pi, 2000, endpoint=False))
    turns = quaternion.from_axis_angle([0.0, 1.0, 0.0], angles)[:, None]
    assert spread(turns) == pytest.approx(np.degrees(0.3), rel=0.01)
    assert spread(np.concatenate([turns[:1000], -turns[1000:]])) == pytest.approx(spread(turns))


def test_jerk_is_the_third_derivative() -> None:
    time = np.arange(100) / 50
    cubic, square = (
        np.stack([factor, 0 * time, 0 * time], axis=-1)[:, None] for factor in (time**3, time**2)
    )
    assert jerk(cubic, 50.0) == pytest.approx(6.0, rel=1e-3)
    assert jerk(square, 50.0) == pytest.approx(0.0, abs=1e-3)
    assert np.isnan(jerk(square[:3], 50.0))


def test_a_low_foot_that_moves_skates_and_a_high_or_slow_one_does_not() -> None:
    time = np.arange(200) / 50

    def feet(speed: float, height: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
        points = np.stack([speed * time, np.full(200, height), 0 * time], axis=-1)[:, None]
        return [points, 0 * points], [points[..., 1], 0 * points[..., 1]]

    assert foot_skate_ratio(*feet(0.6, 0.02), 50.0) == 1.0  # 3 cm a frame at 20 fps
    assert foot_skate_ratio(*feet(0.4, 0.02), 50.0) == 0.0
    assert foot_skate_ratio(*feet(0.6, 0.08), 50.0) == 0.0
    assert np.isnan(foot_skate_ratio([], [], 50.0))


def test_a_body_that_accelerates_on_sliding_feet_has_no_contact() -> None:
    time = np.arange(300) / 50
    path = np.stack([0.2 * np.sin(5 * time), 0 * time, 0 * time], axis=-1)
    standing, sliding = np.zeros((300, 2, 3)), np.repeat(path[:, None], 2, axis=1)
    assert physical_foot_contact(path, [standing, sliding], 50.0) == 0.0  # one foot carries
    assert physical_foot_contact(path, [sliding, sliding], 50.0) > 1.0


def test_frechet_distances_grow_with_what_differs() -> None:
    rng = np.random.default_rng(1)
    known = rng.normal(size=(4000, 3)) * [1.0, 5.0, 0.1]
    assert frechet_distance(known, known) == pytest.approx(0.0, abs=1e-6)
    assert frechet_distance(known + np.array([2.0, 0, 0]), known) == pytest.approx(4.0, rel=0.01)
    assert frechet_distance(known * [1, 0, 1], known) == pytest.approx(1.0, rel=0.01)  # one stands still
    assert np.isnan(frechet_distance(known[:3], known))


def test_clips_have_features_of_their_limbs() -> None:
    dance = danced(motions(5.0, 1))
    bones = dance.skeleton
    positions = bones.forward_kinematics(dance.poses, dance.roots)[0]
    clips = clips_of(positions, 50.0)
    assert len(clips) == 7 and all(len(clip) == 100 for clip in clips)
    kinetic, geometric = kinetic_features(bones, clips, 50.0), geometric_features(bones, clips, 50.0)
    assert kinetic.shape == (7, 48) and (kinetic >= 0).all()
    assert geometric is not None and geometric.shape == (7, 32)
    assert geometric.min() >= 0.0 and geometric.max() <= 1.0 and (geometric.std(axis=0) > 0).sum() > 10
    nameless = replace(bones, names=tuple(f"bone_{joint}" for joint in range(len(bones))))
    assert geometric_features(nameless, clips, 50.0) is None
    twice = kinetic_features(bones, [2 * clip for clip in clips], 50.0)
    np.testing.assert_allclose(twice[:, :32], 4 * kinetic[:, :32], rtol=1e-6)


def test_matching_dances_what_was_recorded_with_the_hand_put_in() -> None:
    stretches = [danced(motions(20.0, seed)).poses[:, PLACES] for seed in (11, 12, 13)]
    held = NAMES.index(ARM)
    phrase = danced(motions(6.0, 1)).poses[:, PLACES].astype(np.float32)
    hand = danced(motions(6.0, 2)).poses[:, PLACES][:, held].astype(np.float32)
    matching = MotionMatching(stretches)
    dance = matching.dance(phrase, held, hand)
    np.testing.assert_array_equal(dance, matching.dance(phrase, held, hand))
    np.testing.assert_allclose(dance[:, held], hand, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(dance, axis=-1), 1.0, atol=1e-5)
    others = [place for place in range(len(NAMES)) if place != held]
    steps = np.degrees(quaternion.angle_between(dance[1:, others], dance[:-1, others]))
    recorded = np.degrees(quaternion.angle_between(stretches[0][1:, others], stretches[0][:-1, others]))
    assert steps.max() < recorded.max() + 180 / FADE_TICKS  # a cut fades, it does not snap
    known = without_heading(np.concatenate(stretches))[:, others]
    first = without_heading(dance[:1])[:, others]
    assert np.degrees(quaternion.angle_between(known, first)).max(axis=1).min() < 0.1  # a recorded moment
    with pytest.raises(ValueError, match="half a second"):
        MotionMatching([stretches[0][:20]])


def test_coverage_is_the_share_that_is_danced() -> None:
    poses = danced(motions(20.0, 21)).poses[:, PLACES]
    recorded = RecordedMotion([poses])
    assert recorded.coverage(poses) > 0.95 and recorded.recall(poses) > 0.95
    assert 0.3 < recorded.coverage(poses[:500]) < 0.8
    assert recorded.coverage(poses[:1].repeat(50, axis=0)) < 0.1


def test_recorded_moments_are_found_again_in_little_memory() -> None:
    """Less than their half seconds take, all at once."""
    poses = danced(motions(1200.0, 21)).poses[:, PLACES]
    half_seconds = poses[::2, :, 0].size * 5 * 9 * 4
    tracemalloc.start()
    recorded = RecordedMotion([poses[:40], poses[40:9000], poses[9000:]])
    (copy, share), (new, _) = (
        recorded.nearest_moments([dance], 4, 2) for dance in (poses[700:1000], poses[1000:700:-3])
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert copy < 0.5 and share < 0.1 and new > 2
    assert peak < half_seconds


def test_a_dance_is_matched_in_little_memory() -> None:
    """Less than three times what is kept."""
    poses = danced(motions(600.0, 21)).poses[:, PLACES].astype(np.float32)
    tracemalloc.start()
    matching = MotionMatching([poses])
    kept = tracemalloc.get_traced_memory()[0]
    matching.dance(poses[:20], 2, poses[:20, 2])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * kept


def cells(line: str) -> list[str]:
    return [cell for cell in line.split("  ") if cell.strip()]


def test_a_row_for_each_dance_and_the_recordings_last() -> None:
    recorded = [swaying(4.0, seed) for seed in (0, 1)]
    takes = [Take(f"{n}", f"{n}", one, one.poses[:, 0, 0] < 2, 50, 50) for n, one in enumerate(recorded)]
    yardstick = Yardstick.of(takes, moving())
    floating = recorded[0].roots.copy()
    floating[:100, 1] += 0.04  # too little for a jump
    made = {
        "as_recorded": measure(recorded[0], yardstick),
        "floating": measure(replace(recorded[0], roots=floating), yardstick, endless=False),
    }
    console = Console(width=80)
    with console.capture() as captured:
        console.print(naturalness_table(made))
    _, head, *rows = (line for line in captured.get().splitlines()[1:] if line.strip(" ─"))
    assert [cell.strip() for cell in cells(head)] == list(UNDER)
    assert [row.strip().split("  ")[0] for row in rows] == ["as recorded", "floating", "recordings"]
    as_recorded, above, own = (cells(row)[1:] for row in rows)
    assert float(as_recorded[2]) == pytest.approx(1, abs=0.3)
    lifted, usual = (float(row[6]) for row in (above, own))
    assert lifted > usual + 1
    assert len(as_recorded) == len(UNDER) and len(above) == len(own) == len(UNDER) - 1, "a seam is a loop's"
