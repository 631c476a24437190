"""`bunraku retarget`: the same dance on another skeleton, with other names, lengths and zero pose."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.cli.pictures import load_dance
from appliance.pose import quaternion
from appliance.pose.body_facts import fronts
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.stage_frame import in_stage_frame
from appliance.studio.exchange.reading import read_as_given
from appliance.studio.exchange.retargeting import leg_m, lowest_m, retarget
from tests.command import Command
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of

LIMBS = (("upper arm", "forearm"), ("forearm", "hand"), ("thigh", "shin"), ("shin", "foot"))


def ways(dance: Recording) -> dict[str, Array]:
    """Unit vectors (N, 3) along each limb."""
    places, _ = dance.skeleton.forward_kinematics(dance.poses, dance.roots)
    found = {}
    for side in ("left", "right"):
        for start, end in LIMBS:
            roles = dance.skeleton.roles
            bone = places[:, roles[f"{side} {end}"]] - places[:, roles[f"{side} {start}"]]
            found[f"{side} {start}"] = bone / np.linalg.norm(bone, axis=-1, keepdims=True)
    return found


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_limbs_point_the_same_way_on_every_skeleton(convention: str) -> None:
    dance, _ = in_stage_frame(dance_of("Mixamo", seconds=3.0))
    target, _ = in_stage_frame(as_the_system_writes(dance_of(convention, 3.0, seed=1), convention))
    found = retarget(dance, target.skeleton)
    assert found.skeleton.names == target.skeleton.names and len(found) == len(dance)
    meant = ways(dance)
    for limb, way in ways(found).items():
        degrees = np.degrees(np.arccos(np.clip((way * meant[limb]).sum(axis=-1), -1, 1)))
        assert degrees.max() < 8.0, limb
    soles = lowest_m(found.skeleton, *found.skeleton.forward_kinematics(found.poses, found.roots))
    assert np.abs(soles).max() < 0.02


def test_a_taller_dancer_walks_further_and_there_and_back_is_the_same_dance() -> None:
    dance, _ = in_stage_frame(dance_of("Mixamo", seconds=3.0))
    tall = replace(dance.skeleton, offsets=dance.skeleton.offsets * 1.2)
    found = retarget(dance, tall)
    assert leg_m(tall) == pytest.approx(1.2 * leg_m(dance.skeleton))
    np.testing.assert_allclose(np.ptp(found.roots[:, 0]), 1.2 * np.ptp(dance.roots[:, 0]), rtol=0.01)
    back = retarget(found, dance.skeleton)
    ours, _ = dance.skeleton.forward_kinematics(dance.poses, dance.roots)
    theirs, _ = back.skeleton.forward_kinematics(back.poses, back.roots)
    np.testing.assert_allclose(theirs, ours, atol=0.02)


def test_the_command_writes_it_and_refuses_unknown_names(tmp_path: Path, bunraku: Command) -> None:
    phrase, other = tmp_path / "phrase.bvh", tmp_path / "other.bvh"
    dance = dance_of("Mixamo", seconds=2.0)
    write_bvh(phrase, dance)
    write_bvh(other, as_the_system_writes(dance_of("LAFAN", 2.0), "LAFAN"))
    bunraku("retarget", phrase, "--to", other, "--out", tmp_path / "out.bvh")
    assert "LeftArm" in read_as_given(tmp_path / "out.bvh")[0].skeleton.names
    nameless = replace(dance.skeleton, names=tuple(f"bone{j}" for j in range(len(dance.skeleton))))
    write_bvh(other, replace(dance, skeleton=nameless))
    refused = bunraku("retarget", phrase, "--to", other, "--out", tmp_path / "no.bvh", status=2)
    assert "no joint that is known as" in refused.err
    assert not (tmp_path / "no.bvh").exists()


def test_every_command_turns_a_dance_as_inspect_says(tmp_path: Path, bunraku: Command) -> None:
    dance = dance_of("Mixamo", seconds=2.0)
    half = quaternion.from_axis_angle([0.0, 1.0, 0.0], np.pi)
    dance.poses[:, 0] = quaternion.multiply(half, dance.poses[:, 0])
    file, other, out = (tmp_path / name for name in ("away.bvh", "other.bvh", "out.bvh"))
    write_bvh(file, dance)
    write_bvh(other, dance_of("CMU", seconds=1.0))

    def ahead(recording: Recording) -> float:
        positions, _ = recording.skeleton.forward_kinematics(recording.poses, recording.roots)
        front = fronts(recording.skeleton, positions)
        assert front is not None
        return float(front[:, 1].mean())

    for command in (("convert", file, out), ("retarget", file, "--to", other, "--out", out)):
        assert "turned to the audience (otherwise: --facing z)" in bunraku(*command).err
        assert ahead(read_bvh(out)) > 0.9
        bunraku(*command, "--facing", "z")
        assert ahead(read_bvh(out)) < -0.9
    assert ahead(load_dance(file).of_puppet(None)) > 0.9
    assert ahead(load_dance(file, ReadingOptions(facing={"*": "z"})).of_puppet(None)) < -0.9
