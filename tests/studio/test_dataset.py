"""Recordings become training data: by take, at their true rate, without capture errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.show.config_error import ConfigError
from appliance.studio.data import dataset
from appliance.studio.data.capture_errors import JUMP, MARKED, CaptureError, sound_frames, without
from appliance.studio.data.catalogue import (
    CATALOGUES,
    Catalogue,
    find_catalogue,
    read_catalogue,
    read_catalogue_file,
)
from appliance.studio.data.dataset import DatasetError, Take, load_dataset, load_take
from appliance.studio.data.mirror import mirror_pairs
from appliance.studio.data.sources import given, remembered
from appliance.studio.evaluation.pictures import longest_sound
from appliance.studio.studio_error import StudioError
from tests.studio.tiny import STILL, moving, swaying, upside_down, write_recordings


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


def test_a_joint_name_that_a_network_s_file_cannot_hold_is_refused_before_training(tmp_path: Path) -> None:
    file = write_recordings(tmp_path / "dancer", count=1) / "sway_0.bvh"
    file.write_text(file.read_text().replace("JOINT lShldr", "JOINT l,Shldr"))
    with pytest.raises(DatasetError, match=r"'l,Shldr' in sway_0\.bvh has a comma in its name"):
        load_dataset(file.parent)


def test_a_take_shorter_than_a_window_gives_none(tmp_path: Path) -> None:
    write_bvh(tmp_path / "short.bvh", swaying(0.1))
    take = load_take(tmp_path / "short.bvh", Catalogue())
    assert not len(dataset.window_starts(take))


def write_known(folder: Path, *names: str) -> list[Path]:
    """Empty files with the names and sizes that the studio's catalogues know."""
    files = []
    for name in names:
        for recording, size in read_catalogue_file(CATALOGUES / f"{name}.yaml").bytes.items():
            files.append(folder / f"{recording}.bvh")
            with files[-1].open("wb") as stream:
                stream.truncate(size)
    return files


def test_the_cmu_dances_are_known_by_names_and_sizes(tmp_path: Path) -> None:
    files = write_known(tmp_path, "cmu_dance")
    found = find_catalogue(tmp_path, files)
    assert found.reading.fps_of("salsa_09") == 60 and found.reading.fps_of("indian_04") == 120
    assert found.take_of("salsa_09") == found.take_of("salsa_24")
    assert "mocap.cs.cmu.edu" in found.acknowledgement
    with files[0].open("ab") as stream:
        stream.write(b"\n")
    assert find_catalogue(tmp_path, files) == Catalogue()


def test_fighters_and_dancers_are_known_alone_and_together(tmp_path: Path) -> None:
    dancers = write_known(tmp_path, "cmu_dance")
    alone = find_catalogue(tmp_path, dancers)
    assert set(alone.held_out) == {"salsa_09", "salsa_24", "salsa_14", "salsa_29", "indian_13"}
    fighters = write_known(tmp_path, "cmu_martial")
    assert find_catalogue(tmp_path, fighters).held_out == ("martial_04",)
    both = find_catalogue(tmp_path, [*fighters, *dancers])
    assert set(both.held_out) == {*alone.held_out, "martial_04"}
    assert both.reading.fps_of("salsa_01") == 60 and both.reading.fps_of("martial_03") == 120
    assert both.acknowledgement == alone.acknowledgement
    own = tmp_path / "martial_99.bvh"
    own.touch()
    assert find_catalogue(tmp_path, [*fighters, own]) == Catalogue()


def test_a_catalogue_beside_the_recordings_goes_before_all(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "dancer", count=2)
    (folder / "catalogue.yaml").write_text("true_fps: {sway_*: 25}\nheld_out: [sway_0]\n")
    found = load_dataset(folder)
    assert [take.name for take in found.held_out] == ["sway_0"]
    assert found.training[0].true_fps == 25
    assert found.training[0].recording.seconds == pytest.approx(8.0, abs=0.1)


def loaded(folder: Path, text: str) -> dict[str, Take]:
    (folder / "catalogue.yaml").write_text(text)
    found = load_dataset(folder)
    return {take.name: take for take in (*found.training, *found.held_out)}


def test_what_people_know_to_be_sound_is_kept_and_what_they_know_to_be_wrong_is_masked(
    tmp_path: Path,
) -> None:
    folder = upside_down(tmp_path / "dancer")
    takes = loaded(folder, "held_out: [sway_2]\n")
    assert not takes["sway_0"].sound[200:300].any() and not takes["sway_1"].sound[400:450].any()
    assert takes["sway_2"].sound.all()

    takes = loaded(folder, "keep: {sway_0: all}\nmask: {'*_2': [[1, 2.5]]}\n")
    assert takes["sway_0"].sound.all() and takes["sway_0"].errors == ()
    assert not takes["sway_1"].sound[400:450].any()
    assert np.flatnonzero(~takes["sway_2"].sound).tolist() == list(range(50, 126))
    assert [error.reason for error in takes["sway_2"].errors] == [MARKED]

    takes = loaded(folder, "keep: {'sway_*': [[3.8, 5], [8, 9]]}\n")
    assert takes["sway_0"].sound[:250].all() and not takes["sway_0"].sound[255:299].any()
    assert takes["sway_1"].sound[402:449].all()


def test_seconds_copied_from_a_picture_leave_nothing_behind() -> None:
    errors = [CaptureError("head", 4.004, 6.013, JUMP, 170.0), CaptureError("neck", 8.0, 8.01, JUMP, 40.0)]
    assert without(errors, [(4.0, 6.0)]) == errors[1:]
    assert without(errors, [(8.0, 8.01)]) == errors[:1]
    assert [(one.start_s, one.end_s) for one in without(errors[:1], [(5.0, 5.5)])] == [
        (4.004, 4.98),
        (5.52, 6.013),
    ]
    assert sound_frames(10, 50.0, []).all()


def test_keep_on_the_command_line_is_remembered(tmp_path: Path) -> None:
    folder = upside_down(tmp_path / "dancer")
    source = given(folder, keep=["sway_0"])
    assert not {take.name for take in source.load(lambda files: files).training if not take.sound.all()} - {
        "sway_1"
    }
    again = remembered({"origin": source.as_state()}, None, tmp_path / "checkpoint.pt")
    assert again.catalogue == source.catalogue
    for asked in ({"keep": ["solo_*"]}, {"held_out": ["solo_*"]}):
        with pytest.raises(StudioError, match=r"'solo_\*' has to be kept, masked or held out, but no"):
            given(folder, **asked)


def test_a_take_that_is_masked_is_not_measured_on(tmp_path: Path) -> None:
    """Neither one without a sound window, nor one whose sound stretches are shorter than a model's window."""
    folder = write_recordings(tmp_path / "dancer", count=3)
    masked = {"sway_2": ((0.0, 9.0),)}
    found = load_dataset(folder, Catalogue(mask=masked))
    assert {take.name for take in found.held_out} == {"sway_2"}
    assert found.measured_on() == found.training
    assert len(longest_sound(found.held_out[0], 60.0)) == 0
    found = load_dataset(folder, Catalogue(mask={"sway_2": ((1.9, 2.1),)}))
    assert found.measured_on() == found.held_out and found.measured_on(128) == found.training


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("held_out: [a]\nkep: {a: all}", r":2: Unknown key 'kep'\. Did you mean 'keep'\?"),
        ("keep:\n  a: all\n  b: every", r":3: 'b' does not say when\. Write 'all', or pairs of seconds"),
        ("mask:\n  a: all", r":2: 'a' does not say when\. Write pairs of seconds"),
        ("keep:\n  a: [[3, 2]]", r":2: 'a' does not say when"),
        ("mask:\n  a: [[-1, 2]]", r":2: 'mask.a\[0\]\[0\]' is -1, out of range"),
        ("true_fps:\n  a: fast", r":2: 'true_fps.a' is 'fast', which is not a number"),
        ("true_fps: {a: 0}", r":1: 'true_fps.a' is 0, out of range"),
        ("held_out: a", r":1: 'held_out' is 'a', which is not a list"),
        ("true_fps: {a: 60", "not YAML"),
    ],
)
def test_a_slip_in_a_catalogue_is_told_with_its_line(tmp_path: Path, text: str, complaint: str) -> None:
    (tmp_path / "catalogue.yaml").write_text(text)
    with pytest.raises(ConfigError, match=complaint):
        read_catalogue(tmp_path / "catalogue.yaml")


def test_a_key_without_a_value_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "catalogue.yaml").write_text("held_out:\ntrue_fps:\n  a: 60\n")
    assert read_catalogue(tmp_path / "catalogue.yaml") == Catalogue(true_fps={"a": 60.0})
