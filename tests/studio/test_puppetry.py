"""Figures of the answer: what a puppet that copies, freezes, shakes or remembers is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.dancer.puppeteers import FixedOrientation
from appliance.pose import quaternion
from appliance.pose.roles import held_joints
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.evaluation import puppetry
from appliance.studio.evaluation.dance_figures import BodyFigures
from appliance.studio.evaluation.in_play import FollowedOrientation, Rehearsal
from appliance.studio.evaluation.measurement import Figures, Measurement, Pair
from appliance.studio.evaluation.nearest import Reference, reference_of, without_heading
from appliance.studio.evaluation.onset import answer_to_steps
from appliance.studio.evaluation.pairs import apart_from, pair_up
from appliance.studio.studio_error import StudioError
from tests.dancer.conftest import random_quaternions
from tests.studio.puppets import NAMES, Freezing, Pasting, Remembering, Turning
from tests.studio.tiny import moving, swaying, write_recordings

PLACES = list(moving())


@pytest.fixture(scope="module")
def pair() -> Pair:
    return Pair(swaying(6.0, seed=1), swaying(6.0, seed=2), "phrase", "hand")


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """What the dancer ever did: the hand's dance among others."""
    return np.concatenate([swaying(6.0, seed=seed).poses[:, PLACES] for seed in (2, 3, 4)])


def figures(coder: Pasting, pair: Pair, poses: np.ndarray, joint: str = "lShldr") -> Figures:
    measurement = Measurement(coder, pair, Reference(poses, 10.0))
    return measurement.with_hand(joint, (10, 9), measurement.hand(joint))


def test_a_puppet_that_pastes_the_arm_on_does_not_answer(pair: Pair, poses: np.ndarray) -> None:
    found = figures(Pasting(), pair, poses)
    assert found.answer == pytest.approx(0.0, abs=0.01)
    assert found.fit == pytest.approx(found.fit_bare, abs=0.1)
    assert found.held < 3.0
    # Blending takes a little of the pace away, of the held joint as of the others.
    assert 0.9 < found.energy < 1.01 and found.roughness < 1.01


def test_a_puppet_that_does_what_the_dancer_did_fits(pair: Pair, poses: np.ndarray) -> None:
    found = figures(Remembering(poses), pair, poses)
    assert found.answer > 5.0
    assert found.fit < 0.7 * found.fit_bare
    assert found.plausibility < 0.5


def test_an_answer_that_is_no_dancers_does_not_fit(pair: Pair, poses: np.ndarray) -> None:
    found = figures(Turning(), pair, poses)
    assert found.answer > 5.0
    assert found.fit > found.fit_bare and found.plausibility > 1.0


def test_a_body_that_comes_to_rest_has_no_energy(pair: Pair, poses: np.ndarray) -> None:
    found = figures(Freezing(), pair, poses)
    assert found.answer > 5.0 and found.energy < 0.01 and found.roughness < 0.01


@pytest.mark.parametrize("joint", ["hip", "head"])
def test_a_hand_does_not_turn_the_whole_dancer(pair: Pair, poses: np.ndarray, joint: str) -> None:
    """The hand on the root carries the other take's tilt, and the phrase's heading."""
    found = figures(Pasting(), pair, poses, joint)
    assert found.answer == pytest.approx(0.0, abs=0.01) and found.held < 3.0


def test_figures_are_in_the_agreed_json(pair: Pair, poses: np.ndarray) -> None:
    reported: list[str] = []
    joints, iterations = ["lShldr", "head"], [(2, 1), (10, 9)]
    found = puppetry.measure(
        [Measurement(Pasting(), pair, Reference(poses, 10.0))], joints, iterations, (1, 10), reported.append
    )
    assert len(reported) == puppetry.dances(1, 2, iterations, (1, 10))
    keys = {"answer", "fit", "fit_own", "fit_bare", "plausibility", "energy", "roughness", "held"}
    for joint in joints:
        assert {"2_1", "10_9", "turning", "onset_ticks"} <= set(found[joint])
        assert keys | {"arm_in_trunk", "arms_touch", "strained", "foot_skate", "snap"} <= set(
            found[joint]["10_9"]
        )
        assert found[joint]["onset_ticks"] is None and found[joint]["step_answer"] == pytest.approx(
            0, abs=0.01
        )
    assert {"plausibility", "energy"} <= set(found["free"]["10"])
    assert found["free"]["10"]["deviation"] < 1.0
    # A pose 180 degrees from all that the dancer did fits nothing.
    assert found["lShldr"]["turning"]["found"] < 0.9


def test_an_answer_is_out_as_soon_as_the_blending_lets_it(pair: Pair) -> None:
    rehearsal = Rehearsal(Turning(), pair.phrase)
    found = answer_to_steps(rehearsal, "lShldr", pair.orientations("lShldr", False), (10, 9))
    assert found.degrees > 10
    assert found.onset_ticks == 1


def test_a_rehearsal_is_what_the_box_plays(pair: Pair) -> None:
    """Without a network in between the dance is the phrase, a little smoother; a still hand is met."""
    rehearsal = Rehearsal(Pasting(), pair.phrase)
    assert len(rehearsal.phrase) == len(rehearsal.recording) == len(rehearsal.free(10)) == 300 - 14
    np.testing.assert_allclose(rehearsal.recording.poses[:, PLACES], rehearsal.phrase, atol=1e-6)
    assert np.degrees(quaternion.angle_between(rehearsal.free(10), rehearsal.phrase)).max() < 0.5
    arm = quaternion.from_axis_angle([1.0, 0.0, 0.0], 1.0)
    danced, shown = rehearsal.held(10, 9, FixedOrientation("lShldr", list(arm)))
    place = NAMES.index("lShldr")
    assert np.degrees(quaternion.angle_between(danced[:, place], arm.astype(np.float32))).max() < 0.1
    np.testing.assert_allclose(shown, np.tile(arm, (len(danced), 1)), atol=1e-6)


def test_a_followed_orientation_is_that_of_its_tick() -> None:
    turns = quaternion.from_axis_angle([0.0, 1.0, 0.0], np.linspace(0, 1, 40))
    hand = FollowedOrientation("head", turns)
    for tick in range(-60, 50):
        target = hand.pull(tick * 0.02)
        np.testing.assert_allclose(target.orientation, turns[min(max(tick, 0), 39)], atol=1e-6)
        assert target.weight == 1.0 or tick < -30


def test_the_nearest_pose_is_the_nearest_one() -> None:
    rng = np.random.default_rng(5)
    known, asked = random_quaternions(rng, 700, 6), random_quaternions(rng, 40, 6)
    reference = Reference(known)
    level = without_heading(asked)
    apart = np.degrees(quaternion.angle_between(level[:, None], without_heading(known)[None]))
    np.testing.assert_allclose(reference.nearest(asked), apart.mean(axis=-1).min(axis=1), atol=0.05)
    hand = random_quaternions(rng, 40)
    held = np.degrees(quaternion.angle_between(hand[:, None], known[None, :, 4])) <= 15.0
    others = [0, 1, 2, 3, 5]
    expected = np.where(held, apart[..., others].mean(axis=-1), np.inf).min(axis=1)
    found = reference.nearest(asked, others, 4, hand)
    assert np.isnan(found).any() and np.isfinite(found).any()
    np.testing.assert_allclose(found[np.isfinite(found)], expected[np.isfinite(expected)], atol=0.05)
    np.testing.assert_array_equal(np.isnan(found), ~held.any(axis=1))


def test_an_arm_in_the_trunk_is_seen_and_a_hanging_one_is_not() -> None:
    phrase = swaying(2.0)
    body, place = BodyFigures(phrase), phrase.skeleton.index("lShldr")
    poses = np.tile(np.array([1.0, 0, 0, 0]), (10, len(phrase.skeleton), 1))
    assert body.arms(poses).arm_in_trunk == 0.0
    poses[:, place] = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.radians(-80))  # it hangs
    assert body.arms(poses).arm_in_trunk == 0.0
    poses[4:, place] = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.radians(-130))  # through the ribs
    assert body.arms(poses).arm_in_trunk == pytest.approx(0.6)
    assert 3.0 < body.arms(poses).arm_depth_cm < 30.0


def test_arms_that_cross_touch_and_arms_apart_do_not() -> None:
    phrase = swaying(2.0)
    body = BodyFigures(phrase)
    poses = np.tile(np.array([1.0, 0, 0, 0]), (10, len(phrase.skeleton), 1))
    assert body.arms(poses).arms_touch == 0.0
    for name, side in (("lShldr", 1), ("rShldr", -1)):  # both to the front and across
        poses[7:, phrase.skeleton.index(name)] = quaternion.from_axis_angle(
            [0.0, 1, 0], side * np.radians(-120)
        )
    assert body.arms(poses).arms_touch == pytest.approx(0.3)


def test_a_joint_is_strained_beyond_all_that_it_ever_did(poses: np.ndarray) -> None:
    reference, danced = Reference(poses), poses[:10].copy()
    assert reference.strained(danced) == 0.0
    head = NAMES.index("head")
    danced[6:, head] = quaternion.from_axis_angle([1.0, 0, 0], 2.5)
    assert reference.strained(danced) == pytest.approx(0.4)
    assert reference.strained(danced, [place for place in range(len(NAMES)) if place != head]) == 0.0
    danced[:, 0] = quaternion.multiply(quaternion.from_axis_angle([1.0, 0, 0], 2.5), danced[:, 0])
    assert reference.strained(danced, [0]) == 0.0  # a root may be anywhere


def test_feet_that_stand_do_not_skate_and_feet_that_swing_do() -> None:
    phrase = swaying(2.0)
    still = np.repeat(phrase.poses[:1], 100, axis=0)
    swinging = still.copy()
    angle = 0.6 * np.sin(np.linspace(0, 40, 100))
    for name, side in (("lThigh", 1), ("rThigh", -1)):
        swinging[:, phrase.skeleton.index(name)] = quaternion.from_axis_angle([1.0, 0, 0], side * angle)
    body = BodyFigures(phrase)
    assert body.foot_skate(*body.grounded(still)) < 0.01 < body.foot_skate(*body.grounded(swinging))


def test_a_hand_of_the_same_take_is_refused_and_both_are_kept_out_of_the_reference(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "dancer", count=4)
    takes = "{one: [sway_0, sway_1]}"
    (folder / "catalogue.yaml").write_text(f"takes: {takes}\nheld_out: [sway_3]\n")
    dataset = load_dataset(folder)
    named = {take.name: take for take in (*dataset.training, *dataset.held_out)}
    with pytest.raises(StudioError, match="of the same take"):
        pair_up([named["sway_0"]], [named["sway_1"]])
    pairs = pair_up([named["sway_0"]], [named["sway_1"], named["sway_2"]])
    assert [(pair.phrase_name, pair.hand_name) for pair in pairs] == [("sway_0", "sway_2")]
    assert [take.name for take in apart_from(dataset, [named["sway_0"]])] == ["sway_2"]
    assert [take.name for take in apart_from(dataset, [named["sway_3"]])] == ["sway_0", "sway_1", "sway_2"]


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        (NAMES, ["lShldr", "rShldr", "lForeArm", "head", "chest", "lThigh"]),
        (
            ("Hips", "Spine", "Spine1", "Head", "LeftShoulder", "LeftArm", "RightArm", "LeftUpLeg"),
            ["LeftArm", "RightArm", "Head", "Spine1", "LeftUpLeg"],
        ),
        (("mixamorig:Hips", "upper_arm.L", "mixamorig:Head"), ["upper_arm.L", "mixamorig:Head"]),
        (("bone1", "bone2"), []),
    ],
)  # fmt: skip
def test_the_held_joints_are_found_on_any_skeleton(joints: tuple[str, ...], expected: list[str]) -> None:
    assert list(held_joints(joints).values()) == expected


def test_the_baselines_of_the_held_out_salsa(dances: Dataset) -> None:
    """Facts of the recordings, whatever the network: a phrase fits its own hand better than a foreign one."""
    named = {take.name: take for take in dances.held_out}
    phrase, hand = named["salsa_29"], named["salsa_24"]
    reference = reference_of(apart_from(dances, [phrase, hand]), dances.moving_names)
    pair = Pair(phrase.recording, hand.recording, phrase.name, hand.name)
    measurement = Measurement(Pasting(dances.moving_names), pair, reference)
    found = measurement.with_hand("lShldr", (10, 9), measurement.hand("lShldr"))
    assert found.answer == pytest.approx(0.0, abs=0.01)
    assert found.fit == pytest.approx(found.fit_bare, abs=0.1)
    assert found.fit_own == pytest.approx(11.4, abs=0.3)
    assert found.fit_bare == pytest.approx(13.1, abs=0.3)
    own = measurement.of_phrase()
    assert own["plausibility_degrees"] == pytest.approx(10.1, abs=0.3)
    assert own["arm_in_trunk"] == pytest.approx(0.02, abs=0.01)
