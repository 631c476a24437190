"""Recordings become training data: by take, at their true rate, without capture errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.studio.data import dataset
from appliance.studio.data.catalogue import Catalogue, find_catalogue
from appliance.studio.data.dataset import DatasetError, load_dataset, load_take
from appliance.studio.data.mirror import mirror_pairs
from tests.studio.tiny import STILL, moving, swaying, write_recordings


def test_both_partners_of_a_take_are_held_out_together(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "dancer", count=4)
    takes = {"sway_0": "one", "sway_1": "one", "sway_2": "two", "sway_3": "three"}
    found = load_dataset(folder, Catalogue(take=takes, held_out=("sway_1",)))
    assert {take.name for take in found.held_out} == {"sway_0", "sway_1"}
    assert {take.name for take in found.training} == {"sway_2", "sway_3"}


def test_without_a_catalogue_one_whole_take_is_held_out(tmp_path: Path) -> None:
    found = load_dataset(write_recordings(tmp_path / "dancer", count=3))
    assert [take.name for take in found.held_out] == ["sway_2"]


def test_only_joints_that_turn_somewhere_are_learned(tmp_path: Path) -> None:
    found = load_dataset(write_recordings(tmp_path / "dancer", count=2))
    assert set(found.skeleton.names) - set(found.moving_names) == set(STILL)


def test_a_glitch_is_masked_at_its_place_in_true_time(tmp_path: Path) -> None:
    smooth = swaying(4.0, fps=100.0)
    poses = smooth.poses.copy()
    turn = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.radians(70.0))
    poses[200, 3] = quaternion.multiply(turn, poses[200, 3])
    write_bvh(tmp_path / "take.bvh", Recording(smooth.skeleton, poses, smooth.roots, 100.0))
    take = load_take(tmp_path / "take.bvh", Catalogue({"*": 50.0}))
    assert len(take.sound) == pytest.approx(400, abs=1)
    assert not take.sound[199:202].any()
    assert take.sound[:197].all() and take.sound[204:].all()
    starts = dataset.window_starts(take)
    assert not set(starts) & set(range(194, 201))
    assert len(dataset.windows([take], moving())) == len(starts)


def assert_mirrored(recording: Recording, but: set[str], asymmetry_m: float = 1e-5) -> None:
    """Forward kinematics of the mirrored dance = the mirrored places of the other side's joints."""
    seen, _ = recording.skeleton.forward_kinematics(recording.poses, recording.roots)
    image = dataset.mirrored(recording)
    places, _ = image.skeleton.forward_kinematics(image.poses, image.roots)
    pairs = mirror_pairs(recording.skeleton)
    kept = [j for j, name in enumerate(recording.skeleton.names) if name not in but]
    assert {int(pairs[j]) for j in kept} == set(kept)
    assert any(pairs[j] != j for j in kept)
    np.testing.assert_allclose(places[:, kept], seen[:, pairs[kept]] * [-1, 1, 1], atol=asymmetry_m)


def test_the_mirror_image_is_a_mirror_image() -> None:
    assert_mirrored(swaying(1.0), but={"leftEye"})


def test_the_mirror_image_of_a_recorded_dancer_is_one(recordings_dir: Path) -> None:
    file = recordings_dir / "train" / "salsa_25.bvh"
    take = load_take(file, find_catalogue(file.parent, [file]))
    assert take.true_fps == 60 and take.header_fps == pytest.approx(120, abs=0.01)
    assert_mirrored(take.recording, but=set(), asymmetry_m=0.006)  # her head sits 5 mm off the middle


def test_windows_bring_their_mirror_images(tmp_path: Path) -> None:
    found = load_dataset(write_recordings(tmp_path / "dancer", count=2))
    once = dataset.windows(found.training, found.moving)
    twice = dataset.windows(found.training, found.moving, mirror=True)
    assert len(twice) == 2 * len(once) == 2 * (200 - 7)
    assert once.shape[1:] == (8, 17, 4) and once.dtype == np.float32


def test_recordings_of_two_skeletons_are_refused_by_name(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "dancer", count=2)
    one = swaying(1.0)
    fewer = replace(one.skeleton, names=one.skeleton.names[:5], parents=one.skeleton.parents[:5], ends=())
    fewer = replace(fewer, offsets=one.skeleton.offsets[:5])
    write_bvh(folder / "other.bvh", Recording(fewer, one.poses[:, :5], one.roots, 50.0))
    with pytest.raises(DatasetError, match=r"sway_0\.bvh has another skeleton than other\.bvh"):
        load_dataset(folder)


def test_nothing_to_train_on_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no \.bvh files"):
        load_dataset(tmp_path)
    folder = write_recordings(tmp_path / "dancer", count=2)
    with pytest.raises(DatasetError, match="Every take is held out"):
        load_dataset(folder, Catalogue(held_out=("*",)))


def test_a_take_shorter_than_a_window_gives_none(tmp_path: Path) -> None:
    write_bvh(tmp_path / "short.bvh", swaying(0.1))
    take = load_take(tmp_path / "short.bvh", Catalogue())
    assert not len(dataset.window_starts(take))
