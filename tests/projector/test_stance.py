"""A body for any zero pose: modelled from a standing pose that the recordings show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.body.body_mesh import body_mesh
from appliance.body.rest_pose import anatomy_of
from appliance.outputs.shared_frame import Facts
from appliance.pose.body import Body
from appliance.pose.body_facts import rest_positions, stands, with_stance
from appliance.pose.bvh import read_bvh
from appliance.pose.skeleton import Skeleton, stance_facts, stance_of
from appliance.pose.stage_frame import in_stage_frame
from appliance.studio.export.packing import write_skeleton
from appliance.studio.export.release import hanging_orientation
from tests.pose.conventions import as_the_system_writes, dance_of


def read(convention: str) -> Skeleton:
    return in_stage_frame(as_the_system_writes(dance_of(convention, seconds=3.0), convention))[0].skeleton


def test_a_figure_s_zero_pose_needs_no_stance() -> None:
    for convention in ("Mixamo", "Unreal", "Vicon"):
        assert read(convention).stance is None


def test_bones_along_x_are_modelled_as_the_body_that_they_are() -> None:
    skeleton, usual = read("LAFAN"), read("Mixamo")
    assert skeleton.stance is not None and not stands(skeleton, rest_positions(skeleton))
    ours, meant = anatomy_of(skeleton), anatomy_of(usual)
    assert ours.height == pytest.approx(meant.height, rel=0.05)
    for role, joint in skeleton.roles.items():
        there = ours.positions[joint] - ours.positions[0]
        expected = meant.positions[usual.roles[role]] - meant.positions[0]
        assert np.linalg.norm(there - expected) < 0.12, role
    assert ours.forward[2] > 0.9 and ours.across[0] > 0.9
    mesh, other = body_mesh(skeleton), body_mesh(usual)
    for low, high in ((mesh.vertices.min(axis=0), other.vertices.min(axis=0)),):
        np.testing.assert_allclose(low - ours.positions[0], high - meant.positions[0], atol=0.12)


def test_the_stance_travels_in_the_bundle_and_to_the_projector(tmp_path: Path) -> None:
    skeleton = read("LAFAN")
    assert skeleton.stance is not None
    found = with_stance(read_bvh(write_skeleton(tmp_path, skeleton, skeleton.stance)))
    assert found.stance is not None
    places, _ = found.forward_kinematics(found.stance, np.zeros(3))
    meant, _ = skeleton.forward_kinematics(skeleton.stance, np.zeros(3))
    np.testing.assert_allclose(places, meant, atol=1e-4)
    carried = stance_of(stance_facts(skeleton))
    assert carried is not None
    np.testing.assert_allclose(carried, skeleton.stance, atol=1e-6)
    assert stance_facts(read("Mixamo")) == {} and stance_of({}) is None
    assert "skeleton" in Facts.__dataclass_fields__


def test_the_neutral_arm_is_that_of_the_stance() -> None:
    skeleton = read("LAFAN")
    assert skeleton.stance is not None
    joint = skeleton.names[skeleton.roles["left upper arm"]]
    hanging = hanging_orientation(skeleton, joint)
    np.testing.assert_allclose(hanging, skeleton.stance[skeleton.index(joint)], atol=1e-3)


def test_a_strip_s_head_is_on_top_whatever_the_zero_pose() -> None:
    heads = []
    for convention in ("Mixamo", "LAFAN"):
        written = as_the_system_writes(dance_of(convention, seconds=3.0), convention)
        dance, _ = in_stage_frame(written)
        positions, world = dance.skeleton.forward_kinematics(dance.poses[0], dance.roots[0])
        cones = Body(dance.skeleton).cones(positions, world)
        ours = cones.joint == dance.skeleton.head
        heads.append(cones.end[ours] - positions[dance.skeleton.head])
    np.testing.assert_allclose(heads[0], heads[1], atol=0.03)
