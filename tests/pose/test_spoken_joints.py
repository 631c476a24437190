"""Joints by the names that people use, for the skeletons of the usual systems."""

from __future__ import annotations

import json
import re

import pytest

from appliance.console.server import FOLDER, languages
from appliance.pose.spoken_joints import PARTS, SIDED_PARTS, spoken_joints
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from tests.pose.conventions import CONVENTIONS, skeleton_of


def spoken_in(convention: str) -> dict[str, str]:
    """By the names of a convention's skeleton, without its prefix."""
    names, prefix = skeleton_of(convention).names, CONVENTIONS[convention].prefix
    return {name.removeprefix(prefix): said for name, said in zip(names, spoken_joints(names), strict=True)}


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_each_joint_of_a_body_has_one_name_of_its_own(convention: str) -> None:
    skeleton = skeleton_of(convention)
    said = dict(zip(skeleton.names, spoken_joints(skeleton.names), strict=True))
    assert all(said[skeleton.names[joint]] for joint in skeleton.roles.values())
    understood = [one for one in said.values() if one]
    assert len(set(understood)) == len(understood)
    for one in understood:
        side, rest = re.fullmatch(r"(left |right )?(.+?)(?: \d+)?", one).groups()  # type: ignore[union-attr]
        assert rest in (SIDED_PARTS if side else PARTS), one


@pytest.mark.parametrize(
    ("convention", "expected"),
    [
        ("Mixamo", {"LeftShoulder": "left collarbone", "LeftArm": "left upper arm"}),
        ("Mixamo", {"Spine": "lower back", "Spine1": "middle back", "Spine2": "chest", "Hips": "hips"}),
        ("Mixamo", {"LeftHandIndex2": "left index finger 2", "RightHandThumb1": "right thumb 1"}),
        ("CMU", {"RightForeArm": "right forearm", "RightToeBase": "right toes", "Spine1": "chest"}),
        ("Xsens", {"LeftShoulder": "left shoulder", "RightElbow": "right elbow", "LeftKnee": "left knee"}),
        ("Unity", {"UpperArm_R": "right upper arm", "LowerLeg_L": "left lower leg", "Spine": "back"}),
        ("Unreal", {"root": "", "pelvis": "hips", "clavicle_l": "left collarbone"}),
    ],
)  # fmt: skip
def test_joints_have_the_names_that_people_use(convention: str, expected: dict[str, str]) -> None:
    assert expected.items() <= spoken_in(convention).items()


def test_the_show_that_comes_with_the_box_and_names_that_nobody_understands() -> None:
    names = load_show(default_show_path()).skeleton.names
    said = dict(zip(names, spoken_joints(names), strict=True))
    expected = {"lShldr": "left shoulder", "rForeArm": "right forearm", "abdomen": "lower back"}
    assert expected.items() <= said.items()
    assert spoken_joints(["Hips", "Tail", "bone12"]) == ["hips", "", ""]


@pytest.mark.parametrize("language", languages())
def test_each_language_has_each_part_of_a_body(language: str) -> None:
    table = json.loads((FOLDER / "words" / f"{language}.json").read_text())
    for part in (*PARTS, *SIDED_PARTS):
        assert table[f"joint_{part.replace(' ', '_')}"].count("|") == (part in SIDED_PARTS), part
