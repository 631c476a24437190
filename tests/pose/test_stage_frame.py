"""Other people's axes, units and roots: turned, scaled and left out once, when a recording is read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from appliance.pose.body_facts import fronts, height_m, sampled_positions
from appliance.pose.skeleton import UnknownJointError
from appliance.pose.stage_frame import FileConventions, in_stage_frame
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of


def assert_the_same_dance(found, meant) -> None:  # type: ignore[no-untyped-def]
    seen, _ = meant.skeleton.forward_kinematics(meant.poses, meant.roots, meant.translations)
    places, _ = found.skeleton.forward_kinematics(found.poses, found.roots, found.translations)
    names = [meant.skeleton.index(name) for name in found.skeleton.names]
    np.testing.assert_allclose(places, seen[:, names], atol=0.02)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_every_convention_arrives_as_the_same_dance(convention: str) -> None:
    meant = dance_of(convention, seconds=4.0)
    written = as_the_system_writes(meant, convention)
    found, _ = in_stage_frame(written)
    assert_the_same_dance(found, meant)
    assert found.skeleton.names[0] == CONVENTIONS[convention].name("hips")
    positions = sampled_positions(found)
    assert 1.2 < height_m(found.skeleton, positions) < 2.2
    front = fronts(found.skeleton, positions)
    assert front is not None and front.mean(axis=0)[1] > 0.9


def test_a_dance_with_its_back_to_the_audience_is_turned_and_left_where_asked() -> None:
    meant = dance_of("Mixamo", seconds=4.0)
    away = replace(meant, poses=meant.poses.copy(), roots=meant.roots * [-1.0, 1.0, -1.0])
    w, x, y, z = np.moveaxis(meant.poses[:, 0], -1, 0)
    away.poses[:, 0] = np.stack([-y, z, w, -x], axis=-1)  # half a turn about y, times the pose
    found, guesses = in_stage_frame(away)
    assert_the_same_dance(found, meant)
    assert "faces -z" in guesses[0].sentence() and "--facing z" in guesses[0].sentence()
    kept, guesses = in_stage_frame(away, FileConventions(facing="z"))
    np.testing.assert_array_equal(kept.poses, away.poses)
    assert guesses == []


def test_a_root_can_be_named_and_an_unknown_one_is_refused() -> None:
    meant = dance_of("Mixamo", seconds=1.0)
    found, guesses = in_stage_frame(meant, FileConventions(root="mixamorig:Spine"))
    assert found.skeleton.names[0] == "mixamorig:Spine" and not guesses
    with pytest.raises(UnknownJointError):
        in_stage_frame(meant, FileConventions(root="nobody"))


def test_what_lies_too_deep_is_set_on_the_floor() -> None:
    meant = dance_of("Mixamo", seconds=2.0)
    sunk = replace(meant, roots=meant.roots - [0.0, 0.9, 0.0])
    found, guesses = in_stage_frame(sunk)
    assert "the floor, at a height of -0.8" in guesses[0].message or "-0.9" in guesses[0].message
    assert abs(float((found.roots - meant.roots)[:, 1].mean())) < 0.06
