"""Landmarks of a video: read in every format, repaired, danced; and what that loses, beside null products."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from appliance.exchange.exchange_error import ExchangeError
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.studio.exchange.landmarks_dance import dance_of
from appliance.studio.exchange.landmarks_file import MEDIAPIPE, LandmarksFile, read_landmarks
from appliance.studio.exchange.landmarks_repair import repaired
from tests.command import Command
from tools.video_loss import Camera, losses, mean_pose, seen_by, still

SECONDS = 3.0
USUAL = Camera()
STEADY = Camera(noise_m=0.0, lost=0.0, hidden_a_minute=0.0, swapped_a_minute=0.0, down_degrees=0.0)


@cache
def true_dance() -> Recording:
    phrase = read_bvh(Path(str(files("appliance.show").joinpath("martial_show", "phrase.bvh"))))
    return phrase.excerpt(0.0, SECONDS)


@cache
def seen(flat: bool = False, camera: Camera = USUAL) -> LandmarksFile:
    return seen_by(camera, true_dance(), np.random.default_rng(1), flat)


@cache
def lost(flat: bool = False, repairs: bool = True) -> Mapping[str, float]:
    found = dance_of(Path("x"), seen(flat), true_dance().skeleton, repairs=repairs).recording
    return losses(found, true_dance())


def write(folder: Path, form: str) -> Path:
    """The landmarks in one of the formats that people have them in."""
    read = seen()
    frames = [
        [[*place, visible] for place, visible in zip(places, visibles, strict=True)]
        for places, visibles in zip(read.points.tolist(), read.seen.tolist(), strict=True)
    ]
    titles = [f"{name}_{axis}" for name in MEDIAPIPE for axis in ("x", "y", "z", "visibility")]
    path = folder / f"dance.{form.rpartition(' ')[2]}"
    if form == "ours json":
        reported = [{"time": at, "world": one} for at, one in zip(read.times.tolist(), frames, strict=True)]
        path.write_text(json.dumps({"frames": reported}))
    elif form == "persons json":
        keys = ("x", "y", "z", "visibility")
        people = [[[dict(zip(keys, point, strict=True)) for point in one]] for one in frames]
        reported = [
            {"timestamp_ms": 1000 * at, "pose_world_landmarks": one}
            for at, one in zip(read.times.tolist(), people, strict=True)
        ]
        path.write_text(json.dumps(reported))
    elif form == "wide csv":
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time", *titles])
            writer.writerows(
                [at, *np.ravel(one)] for at, one in zip(read.times.tolist(), frames, strict=True)
            )
    elif form == "long csv":
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["frame", "time", "landmark", "x", "y", "z", "visibility"])
            for number, (at, one) in enumerate(zip(read.times.tolist(), frames, strict=True)):
                writer.writerows(
                    [number, at, name, *point] for name, point in zip(MEDIAPIPE, one, strict=True)
                )
    elif form == "npz":
        np.savez(path, world=np.array(frames), times=read.times)
    else:
        np.save(path, np.array(frames).reshape(len(frames), -1))
    return path


@pytest.mark.parametrize("form", ["ours json", "persons json", "wide csv", "long csv", "npz", "npy"])
def test_every_format_says_the_same(form: str, tmp_path: Path) -> None:
    found = read_landmarks(write(tmp_path, form))
    np.testing.assert_allclose(found.points, seen().points, atol=1e-9)
    np.testing.assert_allclose(found.seen, seen().seen)
    assert not found.is_flat and found.layout.program == "MediaPipe"
    if form == "npy":
        assert any("no times" in note for note in found.notes)
        assert np.diff(found.times) == pytest.approx(1 / 30)
    else:
        np.testing.assert_allclose(found.times, seen().times, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "text", "line", "named"),
    [
        ("a.json", '{"frames": [\n{"time": 0,\n "world": [}', 3, "no JSON"),
        ("a.json", '[{"time": 0, "world": [[0, 0, 0]]}]', 0, "Frame 0 has 1 landmarks; MediaPipe has 33"),
        ("a.json", '{"frames": []}', 0, "no list of frames"),
        ("a.csv", "frame,landmark,x,y,z\n0,nose,0,0,0\n1,nose,a,0,0\n", 3, "'a' is no number"),
        ("a.csv", "frame,landmark,x,y,z\n0,nose,0,0,0\n0,tail,0,0,0\n", 3, "called 'tail'"),
        ("a.csv", "time,nose_x,nose_y\n0,0,0\n", 1, "left_eye_inner_x and 31 more"),
        ("a.txt", "", 0, "Landmarks are"),
        ("a.npz", "PK\x03\x04 cut", 0, "no landmarks of numpy"),
        ("a.json", f'[{{"time": {"9" * 400}, "world": null}}]', 0, "too large"),
        ("a.json", f'[{{"time": {"9" * 5000}, "world": null}}]', 0, "no JSON"),
    ],
)
def test_a_broken_file_is_refused_with_its_line(
    name: str, text: str, line: int, named: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ExchangeError) as refused:
        read_landmarks(tmp_path / name)
    assert refused.value.line == line and named in str(refused.value) and name in str(refused.value)


def test_times_that_go_back_and_landmarks_of_nobody_are_refused(tmp_path: Path) -> None:
    world = np.zeros((3, 33, 3))
    np.savez(tmp_path / "back.npz", world=world, times=np.array([0.0, 0.1, 0.1]))
    with pytest.raises(ExchangeError, match="Frame 2 is not later"):
        read_landmarks(tmp_path / "back.npz")
    np.savez(tmp_path / "end.npz", world=world, times=np.array([0.0, 0.1, np.inf]))
    with pytest.raises(ExchangeError, match="Frame 2 is not later"):
        read_landmarks(tmp_path / "end.npz")
    np.savez(tmp_path / "rate.npz", world=world, fps=0.0)
    with pytest.raises(ExchangeError, match="its fps is 0"):
        read_landmarks(tmp_path / "rate.npz")
    assert read_landmarks(tmp_path / "back.npz", fps=25.0).times[-1] == pytest.approx(0.08)
    np.savez(tmp_path / "none.npz", world=np.full((3, 33, 3), np.nan))
    with pytest.raises(ExchangeError, match="Nobody was seen"):
        read_landmarks(tmp_path / "none.npz")


def test_a_folder_of_openpose_has_the_person_that_goes_on(tmp_path: Path) -> None:
    """Two persons, of whom a larger one comes in later, and a frame in which nobody is."""
    read = seen(flat=True)
    for frame in range(10):
        points = np.nan_to_num(read.points[frame, :, :2])
        first = np.concatenate([points, np.ones((25, 1))], axis=-1).ravel().tolist()
        second = np.concatenate([3 * points + 500, np.ones((25, 1))], axis=-1).ravel().tolist()
        people = [] if frame == 5 else [second, first] if frame > 2 else [first]
        reported = {"people": [{"pose_keypoints_2d": one} for one in people]}
        (tmp_path / f"dance_{frame:012}_keypoints.json").write_text(json.dumps(reported))
    found = read_landmarks(tmp_path, fps=30.0)
    assert found.is_flat and found.layout.program == "OpenPose BODY_25" and len(found.times) == 10
    assert np.isnan(found.points[5]).all()
    nose = found.layout.parts.index("nose")
    np.testing.assert_allclose(found.points[[0, 4, 9], nose, :2], read.points[[0, 4, 9], nose, :2])
    (tmp_path / "dance_000000000003_keypoints.json").write_text('{"people":\n [{]}')
    with pytest.raises(ExchangeError) as refused:
        read_landmarks(tmp_path)
    assert refused.value.line == 2 and "000000000003" in str(refused.value)


def test_what_is_seen_perfectly_comes_back() -> None:
    """Limbs within a few degrees; the spine as two lines say it; feet that stand do not slide."""
    found = losses(dance_of(Path("x"), seen(camera=STEADY), true_dance().skeleton).recording, true_dance())
    assert found["thighs"] < 6.0 and found["shins"] < 6.0 and found["joints, cm"] < 4.0
    assert found["slide, cm/s"] < 10.0


def test_repairs_help_and_null_products_are_far_off() -> None:
    """Tremble, lost frames, hidden limbs, sides that changed places."""
    still_pose = losses(still(true_dance(), mean_pose(true_dance())), true_dance())
    t_pose = losses(still(true_dance(), true_dance().skeleton.standing), true_dance())
    for limb in ("upper arms", "forearms", "thighs", "shins", "joints, cm"):
        assert lost()[limb] < 0.7 * still_pose[limb] < 0.7 * t_pose[limb], limb
        assert lost()[limb] < lost(repairs=False)[limb], limb
    assert lost()["slide, cm/s"] < 0.4 * lost(repairs=False)["slide, cm/s"]


def test_a_picture_says_less_and_more_than_a_pose_that_stands() -> None:
    t_pose = losses(still(true_dance(), true_dance().skeleton.standing), true_dance())
    flat = lost(flat=True)
    assert lost()["joints, cm"] < flat["joints, cm"] < 0.9 * t_pose["joints, cm"]
    assert flat["thighs"] < 0.6 * t_pose["thighs"]


def test_bones_keep_the_lengths_of_the_skeleton() -> None:
    dance = dance_of(Path("x"), seen(), true_dance().skeleton).recording
    assert dance.translations is None and dance.skeleton is true_dance().skeleton and dance.fps == 50.0
    np.testing.assert_allclose(np.linalg.norm(dance.poses, axis=-1), 1.0, atol=1e-6)
    assert dance.seconds == pytest.approx(SECONDS, abs=0.2)


def test_sides_that_changed_places_are_put_back_and_no_others() -> None:
    read = seen(camera=STEADY)
    parts, swapped = read.layout.parts, read.points.copy()
    for one in ("knee", "ankle", "hip", "toe"):
        left, right = parts.index(f"left {one}"), parts.index(f"right {one}")
        swapped[20:24, [left, right]] = swapped[20:24, [right, left]]
    asked = (parts, read.seen, read.times, 0.5)
    back = repaired(asked[0], swapped, *asked[1:], smooths=False)
    as_it_was = repaired(asked[0], read.points, *asked[1:], smooths=False)
    assert back.swapped == 4 and as_it_was.swapped == 0
    np.testing.assert_allclose(back.points, as_it_was.points)


def test_a_leap_is_left_out_and_a_long_gap_is_told() -> None:
    read = seen(camera=STEADY)
    points, wrist = read.points.copy(), read.layout.parts.index("left wrist")
    points[30, wrist] += 1.0
    points[50:80, wrist] = np.nan
    found = repaired(read.layout.parts, points, read.seen, read.times, 0.5, smooths=False)
    assert found.leaps == 1 and np.isfinite(found.points[:, wrist]).all()
    (gap,) = found.gaps
    assert gap[0] == wrist and gap[2] - gap[1] == pytest.approx(1.0, abs=0.1)
    dance = dance_of(Path("x"), replace(read, points=points), true_dance().skeleton)
    assert any("left wrist not seen from" in line for line in dance.lines)


def test_the_command_makes_a_recording_of_a_video(tmp_path: Path, bunraku: Command) -> None:
    out = tmp_path / "dance.bvh"
    said = bunraku("import", write(tmp_path, "ours json"), "--out", out, "--like", "martial").out
    assert "MediaPipe:" in said and "brought to 50 even ones" in said
    made = read_bvh(out)
    assert made.skeleton.names == true_dance().skeleton.names
    assert losses(made, true_dance())["joints, cm"] < 8.0
    assert out.with_suffix(".png").exists()


def test_options_of_points_are_refused_with_landmarks(tmp_path: Path, bunraku: Command) -> None:
    said = bunraku("import", write(tmp_path, "npz"), "--out", tmp_path / "a.bvh", "--unit", "cm", status=2)
    assert "--unit" in said.err
