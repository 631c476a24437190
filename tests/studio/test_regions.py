"""A dance in a part of the body: the rest keeps the phrase, and the joint between both is halfway."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.studio.data.regions import joints_of, put_on_region
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.studio_error import StudioError
from tests.studio.tiny import moving, skeleton, swaying

BODY = skeleton()


def named(*regions: str) -> set[str]:
    return {BODY.names[joint] for joint in joints_of(regions, BODY, moving())}


def test_regions_are_words_parts_or_joints() -> None:
    left = {"lShldr", "lForeArm", "lHand"}
    assert named("left upper arm") == named("lShldr") == left, "and all below; the collar does not move"
    assert named("arms") == left | {"rShldr", "rForeArm", "rHand"}
    assert named("legs", "head") == {"rThigh", "rShin", "rFoot", "lThigh", "lShin", "lFoot", "head"}
    with pytest.raises(StudioError, match=r"Did you mean 'lShldr'\?.*left upper arm"):
        named("lShlder")
    with pytest.raises(StudioError, match="Nothing moves in leftEye"):
        named("leftEye")


@pytest.mark.parametrize("region", ["arms", "legs", "torso", "left forearm"])
def test_the_rest_keeps_the_phrase_and_nothing_changes_where_the_dance_is_the_phrase(region: str) -> None:
    phrase, dance = (swaying(2.0, seed).poses for seed in (1, 2))
    joints = joints_of([region], BODY, moving())
    mixed = put_on_region(BODY, phrase, dance, joints)
    others = [joint for joint in range(len(BODY)) if joint not in joints]
    np.testing.assert_allclose(quaternion.angle_between(mixed, phrase)[:, others], 0, atol=1e-6)
    inner = [joint for joint in joints if joint and BODY.parents[joint] in joints]
    np.testing.assert_allclose(quaternion.angle_between(mixed, dance)[:, inner], 0, atol=1e-6)
    same = put_on_region(BODY, phrase, phrase, joints)
    np.testing.assert_allclose(quaternion.angle_between(same, phrase), 0, atol=1e-6)


def test_an_arm_on_another_trunk_is_halfway_between_the_body_and_the_room() -> None:
    """Null products: joint angles alone bend the arm with the trunk, places in the room leave it behind."""
    phrase, dance = (swaying(2.0, seed).poses for seed in (1, 1))
    trunk, arm = BODY.index("abdomen"), BODY.index("lShldr")
    bent = quaternion.from_axis_angle([1.0, 0, 0], 0.6)
    dance = dance.copy()
    dance[:, trunk] = quaternion.multiply(np.broadcast_to(bent, dance[:, trunk].shape), dance[:, trunk])
    mixed = put_on_region(BODY, phrase, dance, joints_of(["lShldr"], BODY, moving()))

    def in_room(poses: np.ndarray) -> np.ndarray:
        return BODY.forward_kinematics(without_heading(poses), np.zeros((len(poses), 3)))[1][:, arm]

    from_body = np.degrees(quaternion.angle_between(mixed[:, arm], dance[:, arm]))
    from_room = np.degrees(quaternion.angle_between(in_room(mixed), in_room(dance)))
    np.testing.assert_allclose(from_body, from_room, atol=0.1)
    assert from_body.mean() == pytest.approx(np.degrees(0.3), abs=1.0)


def test_a_turning_dance_does_not_turn_the_phrase() -> None:
    phrase, dance = (swaying(2.0, seed).poses for seed in (1, 2))
    turn = quaternion.from_axis_angle([0.0, 1, 0], 2.0)
    turned = dance.copy()
    turned[:, 0] = quaternion.multiply(np.broadcast_to(turn, dance[:, 0].shape), dance[:, 0])
    for region in ("arms", "torso"):
        joints = joints_of([region], BODY, moving())
        one, other = (put_on_region(BODY, phrase, each, joints) for each in (dance, turned))
        np.testing.assert_allclose(quaternion.angle_between(one, other), 0, atol=1e-5)
        np.testing.assert_allclose(quaternion.heading(one[:, 0]), quaternion.heading(phrase[:, 0]), atol=1e-5)
