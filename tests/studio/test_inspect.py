"""`bunraku inspect`: what a file is, every guess with its option, which a show keeps."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.pose.bvh import write_bvh
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.data.catalogue import Catalogue
from appliance.studio.data.dataset import load_dataset
from appliance.studio.data.remembered import KEY, reading_facts, remembered_reading
from appliance.studio.evaluation.findings import findings
from appliance.studio.inspection import zero_pose
from tests.pose.conventions import as_the_system_writes, dance_of, skeleton_of
from tests.pose.other_frames import scaled
from tests.studio.conftest import bunraku
from tests.studio.test_commands import said


def facts(*arguments: object) -> list[dict]:  # type: ignore[type-arg]
    result = bunraku("inspect", "--json", *arguments)
    assert result.exit_code == 0, said(result)
    return json.loads(result.stdout)  # type: ignore[no-any-return]


def test_a_file_of_the_cmu_s_units_with_z_up_is_described(tmp_path: Path) -> None:
    file = tmp_path / "take.bvh"
    write_bvh(file, as_the_system_writes(dance_of("Vicon", seconds=3.0), "Vicon"))
    (found,) = facts(file)
    assert 1.6 < found["height_m"] < 2.0 and found["zero_pose"] == "a T-pose"
    changed = " ".join(found["changed"])
    for text in ("millimetres", "--metres-per-unit", "Z up to Y up", "--up y", "faces x", "--facing z"):
        assert text in changed
    taken = {joint["name"]: joint["taken_for"] for joint in found["joints"]}
    assert taken["LHumerus"] == "left upper arm" and taken["Thorax"] == "chest"
    text = bunraku("inspect", file).stdout
    assert "LHumerus" in text and "left upper arm" in text and "(--true-fps)" in text


def test_fingers_and_the_whole_trunk_are_recognised_and_a_root_on_the_floor_is_none(tmp_path: Path) -> None:
    file = tmp_path / "take.bvh"
    write_bvh(file, as_the_system_writes(dance_of("Captury", seconds=2.0), "Captury"))
    (found,) = facts(file, "--root", "Root")
    taken = {joint["name"]: joint["taken_for"] for joint in found["joints"]}
    expected = {"LeftHandIndex2": "left index", "Spine2": "spine", "Spine4": "chest", "Root": ""}
    assert {name: taken[name] for name in expected} == expected


def test_an_ending_in_any_case_is_one_and_what_is_left_out_of_a_folder_is_named(tmp_path: Path) -> None:
    for name in ("one.bvh", "two.BVH", "three.Bvh"):
        write_bvh(tmp_path / name, dance_of("Mixamo", seconds=2.0))
    assert [found["name"] for found in facts(tmp_path)] == ["one", "three", "two"]
    assert "Only BVH files" not in said(bunraku("inspect", tmp_path))
    (tmp_path / "._one.bvh").write_bytes(b"of the Finder")
    (tmp_path / "four.GLB").write_bytes(b"")
    (tmp_path / "more").mkdir()
    write_bvh(tmp_path / "more" / "five.bvh", dance_of("Mixamo", seconds=2.0))
    reported = said(bunraku("inspect", tmp_path))
    assert f"Only BVH files are read, left out of {tmp_path}: four.GLB, more/." in reported
    assert "Only BVH files are read, left out: four.GLB, more/." in findings(load_dataset(tmp_path))


@pytest.mark.parametrize("time", ["0", "soon", "-1"])
def test_the_true_rate_makes_a_header_s_nonsense_readable(tmp_path: Path, time: str) -> None:
    file = tmp_path / "take.bvh"
    write_bvh(file, dance_of("Mixamo", seconds=2.0))
    file.write_text(file.read_text().replace("Frame Time: 0.02\n", f"Frame Time: {time}\n"))
    assert "--true-fps" in said(bunraku("inspect", file))
    (found,) = facts(file, "--true-fps", "60")
    assert (found["fps"], found["header_fps"]) == (60.0, 60.0)


def test_rows_that_are_lost_are_said(tmp_path: Path) -> None:
    file = tmp_path / "take.bvh"
    write_bvh(file, dance_of("Mixamo", seconds=2.0))
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:-1], lines[-1][:-20]]))
    (found,) = facts(file)
    assert found["frames"] == 99
    assert f"line {len(lines)}: 1 row lost" in found["changed"][0]


def test_every_guess_can_be_overruled(tmp_path: Path) -> None:
    file = tmp_path / "take.bvh"
    write_bvh(file, as_the_system_writes(dance_of("Unreal", seconds=3.0), "Unreal"))
    assert facts(file)[0]["root"] == "pelvis"
    (found,) = facts(
        file,
        "--root",
        "root",
        "--up",
        "y",
        "--metres-per-unit",
        "0.001",
        "--true-fps",
        "take=30",
        "--facing",
        "z",
    )
    assert found["root"] == "root" and found["fps"] == 30.0
    assert not any("Z up" in note for note in found["changed"])
    assert any("times the present one" in doubt for doubt in found["doubts"])
    refused = bunraku("inspect", file, "--up", "w")
    assert refused.exit_code == 2 and "'w' is not one of y, z" in said(refused)
    refused = bunraku("inspect", file, "--root", "pelvs")
    assert refused.exit_code == 2 and "Did you mean 'pelvis'? Give another --root." in said(refused)


def test_what_is_not_recognised_is_asked(tmp_path: Path) -> None:
    dance = dance_of("Mixamo", seconds=3.0)
    names = tuple(name.replace("Arm", "Branch") for name in dance.skeleton.names)
    write_bvh(tmp_path / "take.bvh", replace(dance, skeleton=replace(dance.skeleton, names=names)))
    (found,) = facts(tmp_path)
    assert "left forearm" in found["doubts"][0] and "left thigh" not in found["doubts"][0]


def test_masked_frames_are_named_drawn_and_kept_on_demand(tmp_path: Path) -> None:
    dance = dance_of("Rokoko", seconds=6.0)
    dance.poses[150:160, dance.skeleton.index("LeftArm")] = [0.0, 1.0, 0.0, 0.0]
    write_bvh(tmp_path / "take.bvh", dance)
    strip = tmp_path / "strip.png"
    (found,) = facts(tmp_path / "take.bvh", "--strip", strip)
    assert found["masked_frames"] >= 10 and "LeftArm" in found["masked"][0]
    assert strip.stat().st_size > 10_000
    assert facts(tmp_path / "take.bvh", "--all-frames")[0]["masked_frames"] == 0


def test_a_show_keeps_how_its_recordings_were_read(tmp_path: Path) -> None:
    reported = Catalogue().with_options(ReadingOptions(up={"*": "z"}, true_fps={"a_*": 60.0}))
    assert reported.reading.fps_of("a_1") == 60.0 and reported.reading.conventions_of("b").up == "z"
    (tmp_path / "report.json").write_text(json.dumps({KEY: reading_facts(reported)}))
    kept = remembered_reading(tmp_path / "puppet.onnx").options
    assert kept.up == {"*": "z"} and kept.fps_of("a_2") == 60.0
    assert ReadingOptions(up={"*": "y"}).over(kept).conventions_of("c").up == "y"


def test_the_kinds_of_zero_poses() -> None:
    kinds = {
        name: zero_pose(as_the_system_writes(dance_of(name, 0.1), name).skeleton)
        for name in ("Mixamo", "LAFAN")
    }
    assert kinds == {"Mixamo": "a T-pose", "LAFAN": "no figure"}
    hanging = skeleton_of("Mixamo")
    offsets = hanging.offsets.copy()
    for side in ("left", "right"):
        offsets[[hanging.roles[f"{side} {part}"] for part in ("forearm", "hand")]] = [0.0, -0.27, 0.0]
    assert zero_pose(replace(hanging, offsets=offsets)) == "standing with hanging arms"
    assert np.isclose(scaled(dance_of("Mixamo", 0.1), 2.0).skeleton.reaches[0], 2 * hanging.reaches[0])
