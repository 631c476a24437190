"""A figure fitted to points: the pose from which they were made comes back, in every layout and any axes."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.point_axes import PointAxes
from appliance.pose.point_fit import PointFit
from appliance.pose.point_layouts import LAYOUTS
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.t_pose import humanoid_rest
from tests.pose.landmarks import Landmarks

BONES = {  # where a limb points: from one joint to the next
    "UpperArm": ("upper arm", "forearm"), "LowerArm": ("forearm", "hand"),
    "UpperLeg": ("thigh", "shin"), "LowerLeg": ("shin", "foot"),
}  # fmt: skip
SIDES = ("left", "right")
Points = Mapping[str, tuple[float, float, float]]


@cache
def phrase() -> Recording:
    return read_bvh(files("appliance.show").joinpath("martial_show", "phrase.bvh"))


def frames(rng: random.Random, count: int = 40) -> list[int]:
    return rng.sample(range(len(phrase().poses)), count)


def points_of(layout: str, frame: int) -> dict[str, tuple[float, float, float]]:
    recording, parts = phrase(), LAYOUTS[layout].parts
    seen = Landmarks(recording.skeleton).seen(parts, recording.poses[frame], recording.roots[frame])
    return {part: (x, y, z) for part, (x, y, z) in zip(parts, seen.tolist(), strict=True) if part and x == x}


def off(layout: str, rng: random.Random) -> dict[str, tuple[list[float], list[float], list[float]]]:
    """For each part of the body, degrees off the dance: of the fit, of a T-pose, of the pose before."""
    recording = phrase()
    skeleton, rest = recording.skeleton, humanoid_rest(recording.skeleton)
    found: dict[str, tuple[list[float], list[float], list[float]]] = {}
    before: Mapping[str, Array] = {}
    for frame in frames(rng):
        turns = PointFit(skeleton).turns(points_of(layout, frame))
        pose, root = recording.poses[frame].astype(float), recording.roots[frame].astype(float)
        positions, world = skeleton.forward_kinematics(pose, root)
        true = {part: world[skeleton.roles[part.lower()]] for part in ("Hips", "Chest")}
        for part, turned in true.items():
            upright = quaternion.inverse(rest[skeleton.roles[part.lower()]])
            true[part] = quaternion.multiply(turned, upright)
            degrees = [
                float(np.degrees(quaternion.angle_between(np.array(other), true[part])))
                for other in (turns[part], quaternion.IDENTITY, before.get(part, true[part]))
            ]
            for column, one in zip(found.setdefault(part, ([], [], [])), degrees, strict=True):
                column.append(one)
        for side in SIDES:
            for bone, (start, end) in BONES.items():
                first, last = skeleton.roles[f"{side} {start}"], skeleton.roles[f"{side} {end}"]
                long = quaternion.rotate(rest[skeleton.parents[last]], skeleton.offsets[last])
                now = positions[last] - positions[first]
                name = f"{side.capitalize()}{bone}"
                ways = [
                    quaternion.rotate(np.array(turns[name]), long),
                    long,
                    before.get(name, now),
                ]
                for column, way in zip(found.setdefault(bone, ([], [], [])), ways, strict=True):
                    cosine = way @ now / np.linalg.norm(way) / np.linalg.norm(now)
                    column.append(float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))
                true[name] = now
        before = true
    return found


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_pose_comes_back_from_its_points(layout: str, rng: random.Random) -> None:
    """Limbs point where they pointed within a tenth of a degree; hips and chest within 35 degrees (95 %), as
    no point says how the spine is shared between them. A T-pose and the pose before are far off.
    """
    for part, (fitted, t_pose, before) in off(layout, rng).items():
        most = 35.0 if part in ("Hips", "Chest") else 0.1
        assert np.percentile(fitted, 95) < most, part
        if part not in ("Hips", "Chest"):
            assert np.mean(t_pose) > 100.0 * np.mean(fitted) and np.mean(before) > 20.0 * np.mean(fitted), (
                part
            )
        else:
            assert np.mean(before) > np.mean(fitted), part


@pytest.mark.parametrize(
    ("layout", "numbers"),
    [  # as the programs' own enumerations have them
        (
            "coco",
            {
                0: "nose",
                3: "left ear",
                5: "left shoulder",
                10: "right wrist",
                11: "left hip",
                16: "right ankle",
            },
        ),
        (
            "h36m",
            {1: "right hip", 6: "left ankle", 8: "", 10: "head", 11: "left shoulder", 16: "right wrist"},
        ),
        (
            "kinect",
            {5: "left shoulder", 10: "left thumb", 14: "right wrist", 18: "left hip", 25: "right toe"},
        ),
        ("kinect", {27: "nose", 29: "left ear", 30: "right eye", 31: "right ear"}),
        ("mediapipe", {0: "nose", 7: "left ear", 11: "left shoulder", 16: "right wrist", 17: "left little"}),
        (
            "mediapipe",
            {20: "right index", 23: "left hip", 28: "right ankle", 31: "left toe", 32: "right toe"},
        ),
        (
            "zed34",
            {2: "chest", 7: "left wrist", 17: "right thumb", 22: "right hip", 27: "nose", 31: "right ear"},
        ),
        (
            "zed38",
            {3: "chest", 5: "nose", 9: "right ear", 12: "left shoulder", 17: "right wrist", 18: "left hip"},
        ),
        ("zed38", {23: "right ankle", 24: "left toe", 32: "left index", 37: "right little"}),
    ],
)
def test_the_points_are_numbered_as_the_programs_number_them(layout: str, numbers: dict[int, str]) -> None:
    assert {number: LAYOUTS[layout].parts[number] for number in numbers} == numbers


@pytest.mark.parametrize(
    "axes",
    [
        lambda x, y, z: (x, y, z),
        lambda x, y, z: (x, -y, -z),  # a camera's
        lambda x, y, z: (x, -z, y),  # Z up
        lambda x, y, z: (x, y, -z),  # Unity's: left-handed
        lambda x, y, z: (-x, -y, -z),  # a camera's picture that is mirrored
        lambda x, y, z: (x, z, y),  # Unreal's: Z up, left-handed
    ],
)
@pytest.mark.parametrize("is_y_down", [False, True])
def test_axes_are_found_from_a_dancer_that_stands(
    axes: Callable[[float, float, float], tuple[float, float, float]], is_y_down: bool
) -> None:
    recording = phrase()
    skeleton = recording.skeleton
    stands = Landmarks(skeleton).seen(
        LAYOUTS["mediapipe"].parts, skeleton.standing, np.array([0.3, 0.9, 2.0])
    )
    points = dict(zip(LAYOUTS["mediapipe"].parts, map(tuple, stands.tolist()), strict=True))
    ours = PointAxes(is_y_down)
    for frame in range(30):
        found = ours.turned({part: axes(*points[part]) for part in filter(None, points)}, frame / 30)
    turns = PointFit(skeleton).turns(found)
    x, y, z = (quaternion.rotate(np.array(turns["Chest"]), axis) for axis in np.eye(3))
    assert y[1] > 0.99 and np.linalg.det([x, y, z]) > 0.99
    nose = np.array(found["nose"]) - 0.5 * (np.array(found["left ear"]) + found["right ear"])
    assert nose @ z > 0.0  # the face is in front of a body whose left side is on its left
    left = quaternion.rotate(np.array(turns["LeftUpperArm"]), np.array([1.0, 0.0, 0.0]))
    assert left @ x > 0.9


def test_sides_that_change_places_for_a_moment_are_put_back_and_a_turn_is_one(rng: random.Random) -> None:
    points = points_of("mediapipe", frames(rng, 1)[0])
    mixed = {
        part: points[part.replace("left", "!").replace("right", "left").replace("!", "right")]
        for part in points
    }
    axes = PointAxes(False)
    for frame in range(20):
        before = axes.turned(points, frame / 30)
    assert axes.turned(mixed, 20 / 30) == before
    assert axes.turned(points, 21 / 30) == before
    for frame in range(22, 60):
        after = axes.turned(mixed, frame / 30)
    assert after["left shoulder"][:2] == before["right shoulder"][:2]  # the figure has turned round


def test_a_point_that_is_not_seen_leaves_its_bones_out_and_no_others(rng: random.Random) -> None:
    points = points_of("mediapipe", frames(rng, 1)[0])
    whole = PointFit(phrase().skeleton).turns(points)
    without = PointFit(phrase().skeleton).turns(
        {part: at for part, at in points.items() if part != "left wrist"}
    )
    assert set(whole) - set(without) == {"LeftLowerArm", "LeftHand"}
    with pytest.raises(ValueError, match="both hips"):
        PointFit(phrase().skeleton).turns({part: at for part, at in points.items() if part != "left hip"})


def test_a_limb_that_passes_through_straight_does_not_spin_about_itself() -> None:
    """An arm bends and straightens for a few seconds: from frame to frame no bone turns far."""
    recording = phrase()
    pose, root = recording.skeleton.standing.copy(), np.array([0.0, 1.0, 0.0])
    forearm = recording.skeleton.roles["left forearm"]
    fit, eyes, parts = PointFit(recording.skeleton), Landmarks(recording.skeleton), LAYOUTS["coco"].parts
    before, most = None, 0.0
    for frame in range(200):
        pose[forearm] = quaternion.from_axis_angle([0.0, -1.0, 0.0], 0.75 * (1.0 - np.cos(frame * 0.1)))
        points = dict(zip(parts, map(tuple, eyes.seen(parts, pose, root).tolist()), strict=True))
        turns = fit.turns({part: at for part, at in points.items() if at[0] == at[0]})
        now = np.array([turns[name] for name in ("LeftUpperArm", "LeftLowerArm")])
        if before is not None:
            most = max(most, float(np.degrees(quaternion.angle_between(now, before)).max()))
        before = now
    assert most < 10.0
