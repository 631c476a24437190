"""Other people's recordings: names, joints, units and axes as other systems have them, few data, one take."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.joint_names import side_of
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.stage_frame import in_stage_frame
from appliance.show.check import verify_bundle
from appliance.show.show import load_show
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.data.catalogue import Catalogue
from appliance.studio.data.dataset import Dataset, DatasetError, load_dataset
from appliance.studio.data.mirror import asymmetry, mirror_pairs, mirrored
from appliance.studio.evaluation.findings import findings, require_windows
from appliance.studio.export.release import first_hand, hanging_orientation
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of, skeleton_of
from tests.pose.other_frames import rezeroed
from tests.studio.bodies import NAMINGS, body, carried, moved, sideways, z_up
from tests.studio.conftest import bunraku
from tests.studio.test_commands import said
from tests.studio.tiny import swaying


def write(folder: Path, *recordings: Recording, metres_per_unit: float = 0.01) -> Path:
    folder.mkdir(exist_ok=True)
    for number, recording in enumerate(recordings):
        write_bvh(folder / f"take_{number}.bvh", recording, metres_per_unit)
    return folder


def reported(dataset: Dataset) -> str:
    return " ".join(findings(dataset))


def assert_two_sided(recording: Recording, axis: int = 0) -> None:
    """The mirrored dance puts every joint where the mirror shows its counterpart."""
    skeleton = recording.skeleton
    pairs, flip = mirror_pairs(skeleton), np.where(np.arange(3) == axis, -1, 1)
    assert sum(pairs != np.arange(len(skeleton))) == len(skeleton) - 6
    seen, _ = skeleton.forward_kinematics(recording.poses, recording.roots)
    image = mirrored(recording)
    places, _ = skeleton.forward_kinematics(image.poses, image.roots)
    np.testing.assert_allclose(places, seen[:, pairs] * flip, atol=1e-6)


@pytest.mark.parametrize("fingers", [0, 5], ids=["22 joints", "42 joints"])
@pytest.mark.parametrize("naming", NAMINGS.values(), ids=NAMINGS)
def test_left_and_right_are_known_however_they_are_called(naming: str, fingers: int) -> None:
    skeleton = body(naming, fingers)
    assert len(skeleton) == 22 + 4 * fingers
    assert_two_sided(moved(skeleton, 2.0))
    assert asymmetry(skeleton, range(len(skeleton))) == ""


@pytest.mark.parametrize("fingers", [0, 5, 9], ids=["22", "42", "58"])
def test_a_folder_of_any_body_is_read_as_it_is(tmp_path: Path, fingers: int) -> None:
    skeleton = body(fingers=fingers)
    found = load_dataset(write(tmp_path / "dancer", *(moved(skeleton, seed=seed) for seed in range(3))))
    assert len(found.moving) == len(skeleton) and found.mirrors
    assert all(take.sound.all() and take.notes == () for take in found.takes)
    assert f"{len(skeleton)} of {len(skeleton)} joints move" in reported(found)
    assert "mirror images besides" in reported(found)


def test_a_file_in_metres_is_read_in_metres(tmp_path: Path) -> None:
    dance = moved(body())
    found = load_dataset(write(tmp_path / "dancer", dance, moved(body(), seed=1), metres_per_unit=1.0))
    take = found.training[0].recording
    np.testing.assert_allclose(take.skeleton.offsets, dance.skeleton.offsets, atol=1e-5)
    np.testing.assert_allclose(take.roots, dance.roots, atol=1e-5)
    assert "take_0, take_1: lengths read as metres" in reported(found)
    known = load_dataset(tmp_path / "dancer", Catalogue(metres_per_unit={"*": 0.5}))
    np.testing.assert_allclose(known.skeleton.offsets, 0.5 * dance.skeleton.offsets, atol=1e-5)


def test_z_up_becomes_y_up(tmp_path: Path) -> None:
    dance = moved(body())
    found = load_dataset(write(tmp_path / "dancer", z_up(dance), z_up(moved(body(), seed=1))))
    take = found.training[0].recording
    assert "turned from Z up to Y up" in reported(found)
    np.testing.assert_allclose(take.skeleton.offsets, dance.skeleton.offsets, atol=1e-5)
    seen, _ = dance.skeleton.forward_kinematics(dance.poses, dance.roots)
    places, _ = take.skeleton.forward_kinematics(take.poses, take.roots)
    np.testing.assert_allclose(places, seen, atol=1e-4)
    assert_two_sided(take)


def test_who_lies_on_the_floor_is_not_set_upright(tmp_path: Path) -> None:
    dance = moved(body())
    lying = z_up(dance)
    lying = replace(lying, skeleton=dance.skeleton, poses=dance.poses.copy())
    lying.poses[:, 0] = np.array([0.7071068, 0.7071068, 0.0, 0.0])
    found = load_dataset(write(tmp_path / "dancer", lying, lying))
    assert not any("turned" in note for note in found.training[0].notes)


def test_a_root_that_only_carries_the_body_is_left_out(tmp_path: Path) -> None:
    dance = moved(body())
    found = load_dataset(write(tmp_path / "dancer", carried(dance), carried(moved(body(), seed=1))))
    assert found.skeleton.names == dance.skeleton.names
    assert "Reference, which only carries Hips, left out" in reported(found)
    take = found.training[0].recording
    seen, _ = dance.skeleton.forward_kinematics(dance.poses, dance.roots)
    places, _ = take.skeleton.forward_kinematics(take.poses, take.roots, take.translations)
    np.testing.assert_allclose(places, seen, atol=1e-4)


def test_hips_that_are_held_still_remain_the_root(tmp_path: Path) -> None:
    dances = [moved(body(), seed=seed) for seed in range(2)]
    for dance in dances:
        dance.poses[:, 0] = [1.0, 0.0, 0.0, 0.0]
    found = load_dataset(write(tmp_path / "dancer", *dances))
    assert found.moving_names[0] == "Hips"


def test_left_and_right_along_z_are_mirrored_there() -> None:
    assert_two_sided(sideways(moved(body(), 2.0)), axis=2)


def axes_along_bones(dance: Recording, kind: str) -> Array:
    """(J, 4): world rotations to a zero pose in which each bone lies along x of its joint, as rigs have it.

    On the right all axes point the other way (Maya's 'behaviour'), or only one (Biped).
    """
    skeleton, zero = dance.skeleton, []
    for joint in range(len(skeleton)):
        below = [c for c, parent in enumerate(skeleton.parents) if parent == joint]
        side = side_of(skeleton.names[joint])
        bone = skeleton.offsets[below[0]] if below else skeleton.offsets[joint]
        x = bone / np.linalg.norm(bone) * np.where([side < 0, False, False], -1.0, 1.0)
        z = np.cross(x, [0.0, 0.1, 1.0] if abs(x[2]) < 0.9 else [0.1, 1.0, 0.0])
        frame = np.stack([x, np.cross(z, x) / np.linalg.norm(z), z / np.linalg.norm(z)], axis=-1)
        if side < 0:
            flip = np.diag([-1.0, -1.0, -1.0] if kind == "behaviour" else [1.0, 1.0, -1.0])
            frame = np.diag([-1.0, 1.0, 1.0]) @ frame @ flip
        zero.append(quaternion.inverse(quaternion.from_matrix(frame)))
    return np.stack(zero)


@pytest.mark.parametrize("kind", ["shortest", "behaviour", "Biped"])
def test_rigs_whose_bones_lie_along_local_axes_are_mirrored(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "dancer"
    folder.mkdir()
    for seed in range(2):
        if kind == "shortest":
            written = as_the_system_writes(dance_of("LAFAN", seed=seed), "LAFAN")
        else:
            dance = dance_of("LAFAN", seed=seed)
            written = rezeroed(dance, axes_along_bones(dance, kind))
        write_bvh(folder / f"take_{seed}.bvh", written)
    found = load_dataset(folder)
    assert found.skeleton.stance is not None
    assert found.asymmetry == "" and "mirror images besides" in reported(found)
    recording = found.takes[0].recording
    skeleton, pairs = recording.skeleton, mirror_pairs(recording.skeleton)
    seen, _ = skeleton.forward_kinematics(recording.poses, recording.roots)
    image = mirrored(recording)
    places, _ = skeleton.forward_kinematics(image.poses, image.roots)
    np.testing.assert_allclose(places, seen[:, pairs] * [-1, 1, 1], atol=0.005)
    back = mirrored(image)
    apart = np.degrees(quaternion.angle_between(back.poses, recording.poses))
    assert apart.max() < 1.0


def test_a_rig_along_local_axes_that_is_lame_is_not_mirrored_and_named() -> None:
    dance = dance_of("LAFAN")
    dance.skeleton.offsets[dance.skeleton.index("LeftFoot")] *= 0.6
    written, _ = in_stage_frame(rezeroed(dance, axes_along_bones(dance, "behaviour")))
    assert written.skeleton.stance is not None
    why = asymmetry(written.skeleton, range(len(written.skeleton)))
    assert why == "LeftFoot and RightFoot are not each other's mirror image in the rest pose"


def test_a_body_without_two_sides_is_not_mirrored_and_it_is_said_why(tmp_path: Path) -> None:
    plain = body("{side}{joint}")
    nameless = replace(plain, names=tuple(f"joint{number}" for number in range(len(plain))))
    assert "no joint's name says" in asymmetry(nameless, range(len(plain)))
    lame = replace(plain, offsets=plain.offsets.copy())
    lame.offsets[lame.index("LeftLeg")] *= 0.7
    assert asymmetry(lame, range(len(plain))).startswith("LeftLeg and RightLeg are not each other's")
    found = load_dataset(write(tmp_path / "dancer", moved(lame), moved(lame, seed=1)))
    assert not found.mirrors
    assert "Not learned from the mirror's side too: LeftLeg and RightLeg" in reported(found)
    assert "mirror images besides" not in reported(found)
    training = Training(found, Settings(steps=1, width=16, latent=4, batch=8))
    assert len(training.train_windows) == 12 * 50 - 7


def test_axes_that_are_turned_on_one_side_are_not_mirrored(tmp_path: Path) -> None:
    """Offsets are symmetrical, but the axes of one toe are turned by half a turn, as some rigs have it."""
    dances = [moved(body(), seed=seed) for seed in range(2)]
    for dance in dances:
        toe = dance.skeleton.index("RightToe")
        turned = dance.poses[:, toe] * 0.2 + np.array([0.0, 1.0, 0.0, 0.0])
        dance.poses[:, toe] = quaternion.normalize(turned)
    found = load_dataset(write(tmp_path / "dancer", *dances))
    assert "Toe do not turn about mirrored axes" in found.asymmetry


def test_of_one_take_alone_the_end_is_kept_apart(tmp_path: Path) -> None:
    found = load_dataset(write(tmp_path / "dancer", moved(body(), 20.0)))
    (training,), (end,) = found.training, found.held_out
    assert (len(training.recording), len(end.recording)) == (800, 150)
    assert (training.name, end.name, end.file) == ("take_0", "take_0 from 17.0 s on", "take_0")
    np.testing.assert_allclose(end.recording.roots[0], moved(body(), 20.0).roots[850], atol=1e-5)
    assert "1 recording of 1 take," in reported(found)
    assert "the end of the only take: take_0 from 17.0 s on" in reported(found)
    assert not load_dataset(write(tmp_path / "short", moved(body(), 8.0))).held_out
    (longer,) = load_dataset(write(tmp_path / "longer", moved(body(), 40.0))).held_out
    assert longer.begins_s == 34.0


def test_one_short_take_of_many_joints_trains_to_a_show_that_is_measured(tmp_path: Path) -> None:
    folder, out = write(tmp_path / "dancer", z_up(moved(body(fingers=5), 12.0))), tmp_path / "show"
    options = ["--steps", 2, "--width", 32, "--latent", 8, "--threads", 1, "--device", "cpu"]
    result = bunraku("train", "--recordings", folder, "--out", out, *options)
    assert result.exit_code == 0, said(result)
    assert verify_bundle(out) == []
    report = json.loads((out / "report.json").read_text())
    assert report["evaluated_on"] == ["take_0 from 9.0 s on"]
    assert "not_measured" not in report["puppetry"]
    assert read_bvh(out / "phrase.bvh").seconds == pytest.approx(8.0, abs=0.1)


@pytest.mark.usefixtures("unmeasured")
def test_a_body_without_named_feet_trains_to_a_show_that_dances_and_says_what_it_cannot(
    tmp_path: Path,
) -> None:
    def footless(dance: Recording) -> Recording:
        names = tuple(name.replace("Foot", "Tip") for name in dance.skeleton.names)
        return replace(dance, skeleton=replace(dance.skeleton, names=names))

    takes = write(tmp_path / "dancer", *(footless(swaying(14.0, seed)) for seed in (1, 2)))
    out = tmp_path / "show"
    options = ["--steps", 2, "--width", 32, "--latent", 8, "--threads", 1, "--device", "cpu"]
    result = bunraku("train", "--recordings", takes, "--out", out, *options)
    assert result.exit_code == 0, said(result)
    show, report = load_show(out), (out / "report.json").read_text()
    assert not show.skeleton.feet and not show.config.motion.grounded and verify_bundle(out) == []
    assert json.loads(report)["phrase"]["naturalness"]["slide_cm_s"] is None and "NaN" not in report
    refused = bunraku("granular", out / "checkpoint.pt", "--out", tmp_path / "x.bvh", "--seconds", 2)
    assert refused.exit_code == 2 and "named foot or ankle" in said(refused)


def test_errors_of_a_part_are_at_their_place_in_it(tmp_path: Path) -> None:
    folder = write(tmp_path / "dancer", moved(body(), 20.0))
    found = load_dataset(folder, Catalogue(mask={"*": ((15.5, 17.5), (19.0, 19.5))}))
    (training,), (end,) = found.training, found.held_out
    assert [(one.start_s, one.end_s) for one in training.errors] == [(15.5, 16.0)]
    assert [(one.start_s, one.end_s) for one in end.errors] == [(0.0, 0.5), (2.0, 2.5)]
    assert not end.sound[:26].any() and end.sound[27:99].all()


def test_few_data_are_told_and_too_few_refused_with_the_figure(tmp_path: Path) -> None:
    found = load_dataset(write(tmp_path / "dancer", swaying(6.0), swaying(4.0, seed=1)))
    assert "Only 6 s of dance to learn from" in reported(found)
    require_windows(found, 293)
    with pytest.raises(DatasetError, match=r"Only 293 windows .*about 5\.9 s.*At least 294 are needed"):
        require_windows(found, 294)
    out = tmp_path / "show"
    short = write(tmp_path / "short", swaying(3.0), swaying(3.0, seed=1))
    refused = bunraku("train", "--recordings", short, "--out", out, "--steps", 2)
    assert refused.exit_code == 2
    assert "Only 143 windows" in said(refused) and "too few to learn anything" in said(refused)
    assert not (out / "checkpoint.pt").exists()


def test_recordings_without_motion_are_refused(tmp_path: Path) -> None:
    still = swaying(4.0)
    still = replace(still, poses=np.tile(still.poses[:1], (len(still), 1, 1)))
    with pytest.raises(DatasetError, match="Nothing moves"):
        load_dataset(write(tmp_path / "dancer", still, still))


def test_recordings_of_nothing_but_errors_are_refused(tmp_path: Path) -> None:
    folder = write(tmp_path / "dancer", swaying(4.0), swaying(4.0, seed=1))
    with pytest.raises(DatasetError, match="Every frame is masked"):
        load_dataset(folder, Catalogue(mask={"*": ((0.0, 9.0),)}))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_first_hand_is_the_upper_arm(convention: str) -> None:
    skeleton = skeleton_of(convention)
    assert first_hand(skeleton, skeleton.names) == (CONVENTIONS[convention].name("left upper arm"), "")
    pairs = mirror_pairs(skeleton)
    assert pairs[skeleton.roles["left toe"]] == skeleton.roles["right toe"]


def test_an_unknown_name_is_told_and_the_shape_decides() -> None:
    skeleton = skeleton_of("Mixamo")
    nameless = replace(skeleton, names=tuple(f"bone{number}" for number in range(len(skeleton))))
    name, doubt = first_hand(nameless, nameless.names)
    assert nameless.index(name) == skeleton.roles["left upper arm"]
    assert "No joint has a name that is known for an arm" in doubt and name in doubt


def test_an_upper_arm_that_does_not_move_is_told() -> None:
    skeleton = skeleton_of("Unreal")
    name, doubt = first_hand(skeleton, [n for n in skeleton.names if n != "upperarm_l"])
    assert name == "lowerarm_l"
    assert "The left upper arm does not move" in doubt


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_arm_of_a_dancer_who_stands_still_hangs(convention: str) -> None:
    skeleton = in_stage_frame(as_the_system_writes(dance_of(convention, 2.0), convention))[0].skeleton
    arm, elbow = (skeleton.roles[f"left {part}"] for part in ("upper arm", "forearm"))
    neutral = hanging_orientation(skeleton, skeleton.names[arm])
    assert neutral is not None
    pose = skeleton.standing.copy()
    pose[arm] = neutral
    places, _ = skeleton.forward_kinematics(pose, np.zeros(3))
    way = places[elbow] - places[arm]
    assert -way[1] > np.sin(np.radians(70.0)) * np.linalg.norm(way)


def test_what_is_no_upper_arm_stays_as_it_rests() -> None:
    skeleton = skeleton_of("Mixamo")
    for part in ("hips", "left forearm", "left hand", "head", "left thigh"):
        assert hanging_orientation(skeleton, skeleton.names[skeleton.roles[part]]) is None
