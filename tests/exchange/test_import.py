"""`bunraku import`: points become a dance of a fitted skeleton, and its distance from them is said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.formats import write_recording
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.exchange.fitting import fit_skeleton, pose_frames
from appliance.studio.exchange.importing import PointsOptions, import_points
from appliance.studio.exchange.points_file import read_names, read_points
from appliance.studio.exchange.topology import directions_at_rest, parents_by_name
from tests.command import Command
from tests.logged import said
from tests.pose.conventions import as_the_system_writes, dance_of
from tests.studio.bodies import NAMINGS, body, moved


def points_of(recording: Recording) -> Array:
    places, _ = recording.skeleton.forward_kinematics(
        recording.poses, recording.roots, recording.translations
    )
    return places


def mean_cm(found: Recording, points: Array) -> float:
    return float(100 * np.linalg.norm(points_of(found) - points, axis=-1).mean())


def test_a_shin_points_down_at_rest_and_a_foot_forwards() -> None:
    figure = body()
    directions = directions_at_rest(figure.names, figure.parents)
    assert directions is not None
    assert directions[figure.index("LeftFoot")][1] == -1.0
    assert directions[figure.index("LeftToe")][2] > 0.8
    assert directions[figure.index("RightHand")][0] == -1.0


def test_a_foot_without_toes_points_forwards() -> None:
    figure = body()
    kept = [joint for joint, name in enumerate(figure.names) if "Toe" not in name]
    names = [figure.names[joint] for joint in kept]
    parents = parents_by_name(names)
    assert not isinstance(parents, str)
    points = points_of(moved(figure, seconds=1.0))[:, kept]
    fitted_figure = fit_skeleton(names, parents, points, directions_at_rest(names, parents))
    tips = dict(fitted_figure.ends)
    for foot in fitted_figure.feet:
        assert tips[foot][2] > 0.1


def test_the_names_of_real_recordings_say_what_hangs_on_what(recordings_dir: Path) -> None:
    for path in (
        next(recordings_dir.glob("**/salsa_18.bvh")),
        next(recordings_dir.glob("**/martial_05.bvh")),
    ):
        figure = read_bvh(path).skeleton
        assert parents_by_name(figure.names) == list(figure.parents), path.name


def fitted(figure: Skeleton, points: Array) -> Recording:
    directions = directions_at_rest(figure.names, figure.parents)
    skeleton = fit_skeleton(figure.names, figure.parents, points, directions)
    return pose_frames(skeleton, points, 50.0, 0.5)[0]


def bone_directions(recording: Recording) -> Array:
    points, parents = points_of(recording), recording.skeleton.parents
    bones = points[:, 1:] - points[:, list(parents[1:])]
    return bones / np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), 1e-12)


def degrees_apart(a: Array, b: Array) -> Array:
    return np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1), -1.0, 1.0)))


@pytest.mark.parametrize("seed", range(3))
def test_a_synthetic_dance_comes_back(seed: int) -> None:
    meant = moved(body(), seconds=4.0, seed=seed)
    found = fitted(meant.skeleton, points_of(meant))
    assert mean_cm(found, points_of(meant)) < 0.1
    assert degrees_apart(bone_directions(found), bone_directions(meant)).max() < 1.0


def test_real_dances_come_back(recordings_dir: Path) -> None:
    """With fingers, eyes, and bones without length, as the CMU recordings have them."""
    paths = sorted(recordings_dir.glob("**/*.bvh"))
    for path in (paths[0], next(recordings_dir.glob("**/salsa_18.bvh")), paths[-1]):
        meant = read_bvh(path, drop_tpose=True).excerpt(0.0, 10.0)
        points = points_of(meant)
        found = fitted(meant.skeleton, points)
        assert mean_cm(found, points) < 0.5, path.name
        lengths = np.linalg.norm(meant.skeleton.offsets[1:], axis=-1)
        apart = degrees_apart(bone_directions(found), bone_directions(meant))[:, lengths > 0.05]
        assert np.percentile(apart, 95) < 2.0, path.name


def test_with_the_true_skeleton_the_joints_with_several_bones_turn_as_they_did() -> None:
    meant = moved(body(), seconds=4.0)
    found, _ = pose_frames(meant.skeleton, points_of(meant), 50.0, 0.5)
    for name in ("Hips", "UpperChest"):
        joint = meant.skeleton.index(name)
        _, here = found.skeleton.forward_kinematics(found.poses, found.roots)
        _, there = meant.skeleton.forward_kinematics(meant.poses, meant.roots)
        apart = np.degrees(quaternion.angle_between(here[:, joint], there[:, joint]))
        assert apart.max() < 0.5, name


def test_a_joint_whose_twist_is_open_turns_smoothly() -> None:
    meant = moved(body(), seconds=4.0)
    found = fitted(meant.skeleton, points_of(meant))
    steps = np.degrees(quaternion.angle_between(found.poses[1:], found.poses[:-1]))
    assert steps.max() < 10.0


def test_a_bone_that_swings_through_backwards_does_not_flip() -> None:
    """The shortest turn from the parent is undetermined where the bone points against it."""
    figure = Skeleton(
        ("Hips", "Spine", "Neck"), (-1, 0, 1), np.array([[0, 0, 0], [0, 0.5, 0], [0, 0.5, 0.0]])
    )
    time = np.arange(200) / 50.0
    identity = np.tile(quaternion.IDENTITY.astype(float), (200, 3, 1))
    poses = identity.copy()
    tilt = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.full(200, 0.04))
    poses[:, 1] = quaternion.multiply(tilt, quaternion.from_axis_angle([1.0, 0.0, 0.0], 1.5 * time))
    meant = Recording(figure, poses, np.zeros((200, 3)), 50.0)
    found, _ = pose_frames(figure, points_of(meant), 50.0, 0.5)
    np.testing.assert_allclose(points_of(found), points_of(meant), atol=1e-6)
    steps = np.degrees(quaternion.angle_between(found.poses[1:], found.poses[:-1]))
    assert steps.max() < 30.0  # without the filter 150


def test_noise_of_the_cameras_stays_noise() -> None:
    meant = moved(body(), seconds=4.0)
    points = points_of(meant)
    noisy = points + np.random.default_rng(1).normal(scale=0.003, size=points.shape)
    found = fitted(meant.skeleton, noisy)
    assert mean_cm(found, points) < 1.0
    long = np.linalg.norm(meant.skeleton.offsets[1:], axis=-1) > 0.2
    apart = degrees_apart(bone_directions(found), bone_directions(meant))[:, long]
    assert np.percentile(apart, 95) < 3.0


def test_gaps_are_crossed_and_long_ones_keep_the_bone_s_length() -> None:
    meant = moved(body(), seconds=4.0)
    points = points_of(meant)
    holed = points.copy()
    short, long = meant.skeleton.index("LeftForeArm"), meant.skeleton.index("RightHand")
    holed[50:60, short] = np.nan
    holed[80:140, long] = np.nan
    skeleton = fit_skeleton(meant.skeleton.names, meant.skeleton.parents, holed)
    found, too_long = pose_frames(skeleton, holed, 50.0, 0.5)
    assert [(gap.joint, gap.first, gap.last) for gap in too_long] == [(long, 80, 139)]
    apart = np.linalg.norm(points_of(found) - points, axis=-1)
    assert apart[:, short].max() < 0.02
    seen = ~np.isnan(holed).any(axis=-1)
    assert 100 * apart[seen].mean() < 0.5
    assert np.isfinite(found.poses).all()


@pytest.mark.parametrize("naming", NAMINGS)
def test_names_say_what_hangs_on_what(naming: str) -> None:
    figure = body(NAMINGS[naming])
    parents = parents_by_name(figure.names)
    assert not isinstance(parents, str), parents
    by_name = dict(zip(figure.names, [figure.names[p] if p >= 0 else "" for p in parents], strict=True))
    meant = dict(zip(figure.names, [figure.names[p] if p >= 0 else "" for p in figure.parents], strict=True))
    wrong = {name for name in meant if by_name[name] != meant[name]}
    assert not wrong


def test_the_names_of_trackers_and_of_the_first_dancers_are_known() -> None:
    trackers = ("pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle")
    trackers += ("neck", "head", "left_shoulder", "left_elbow", "left_wrist")
    parents = parents_by_name(trackers)
    assert parents == [-1, 0, 1, 2, 0, 4, 5, 0, 7, 0, 9, 10]
    cmu = ("hip", "abdomen", "chest", "neck", "head", "rCollar", "rShldr", "rForeArm", "rHand", "lThigh")
    assert parents_by_name(cmu) == [-1, 0, 1, 2, 3, 2, 5, 6, 7, 0]


def test_the_command_writes_a_dance_a_picture_and_the_error(tmp_path: Path, bunraku: Command) -> None:
    meant = moved(body(), seconds=2.0)
    points = points_of(meant)
    z_up_mm = 1000 * points[..., [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    z_up_mm[20:25, 7] = np.nan
    np.save(tmp_path / "points.npy", z_up_mm)
    (tmp_path / "names.txt").write_text("# joints\n" + "\n".join(meant.skeleton.names) + "\n")
    said = bunraku(
        *("import", tmp_path / "points.npy", "--names", tmp_path / "names.txt", "--up", "z"),
        *("--out", tmp_path / "dance.bvh"),
    ).out
    assert "Unit: mm" in said
    assert "Gaps: 1 of up to 0.10 s" in said
    assert "Distance from the points, cm: mean 0." in said
    assert "  LeftHand" in said
    found = read_bvh(tmp_path / "dance.bvh")
    assert 100 * np.linalg.norm(points_of(found) - points, axis=-1).mean() < 0.5
    assert (tmp_path / "dance.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_with_names_and_the_skeleton_of_a_recording(tmp_path: Path, bunraku: Command) -> None:
    meant = moved(body(), seconds=1.0)
    write_bvh(tmp_path / "like.bvh", meant)
    shuffled = [*range(len(meant.skeleton))][::-1]
    names = [meant.skeleton.names[joint] for joint in shuffled]
    table = points_of(meant)[:, shuffled].reshape(len(meant), -1)
    rows = [",".join(f"{value:.6f}" for value in row) for row in np.c_[np.arange(len(meant)) / 50, table]]
    rows[3] = rows[3].split(",", 4)[0] + ",,,," + rows[3].split(",", 4)[4]
    header = "time," + ",".join(f"{name}.{axis}" for name in names for axis in "xyz")
    (tmp_path / "points.csv").write_text("\n".join([header, *rows]))
    out = tmp_path / "dance.bvh"
    bunraku("import", tmp_path / "points.csv", "--like", tmp_path / "like.bvh", "--out", out)
    found = read_bvh(out)
    assert found.skeleton.names == meant.skeleton.names
    np.testing.assert_allclose(found.skeleton.offsets, meant.skeleton.offsets, atol=1e-4)


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("a\nb, c, d\n", ":2:"),
        ("a\na\n", ":2: 'a' is named twice"),
        ("a, -\nb\n", ":2: Give each name a parent"),
        ("# nothing\n", "No name is in it"),
        ("a, -\nb, x\n", "'x', is no name"),
    ],
)
def test_wrong_names_are_named_with_their_line(text: str, where: str, tmp_path: Path) -> None:
    (tmp_path / "names.txt").write_text(text)
    with pytest.raises(ExchangeError) as refused:
        read_names(tmp_path / "names.txt")
    assert where in str(refused.value)


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("Hips.x,Hips.y,Hips.z\n1,2\n", ":2: This line has 2 values"),
        ("Hips.x,Hips.y,Hips.z\n1,5,2,5,3,5\n", "decimal commas? Save it with semicolons"),
        ("Hips.x,Hips.y,Hips.z\n1,2,x\n", ":2: "),
        ("Hips.x,Hips.y\n1,2\n", "no multiple of three"),
        ("Hips.x,Head.y,Hips.z\n1,2,3\n", ":1: Columns"),
        ("1,2,3\n", "--names FILE"),
        ("", "p.csv"),
    ],
)
def test_wrong_tables_are_named_with_their_line(text: str, where: str, tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(ExchangeError) as refused:
        read_points(tmp_path / "p.csv", None)
    assert where in str(refused.value)


def test_wrong_shapes_and_unknown_names_end_with_what_to_do(tmp_path: Path, bunraku: Command) -> None:
    names, points, out = tmp_path / "names.txt", tmp_path / "p.npy", tmp_path / "o.bvh"
    names.write_text("Hips\nBlob\n")
    for array, message in (
        (np.zeros((5, 2, 2)), "it must be (frames, points, 3)"),
        (np.zeros((5, 3, 3)), "3 points, but 2 names"),
        (np.full((5, 2, 3), np.inf), "never seen"),
        (np.full((5, 2, 3), np.nan), "never seen"),
        (np.ones((5, 2, 3)), "Write the parent behind each name"),
        (np.array([["a"]]), "no numbers"),
    ):
        np.save(points, array)
        assert (
            message in bunraku("import", points, "--names", names, "--out", out, "--unit", "m", status=2).err
        )
    points.write_bytes(b"hello")
    assert "no NPY file" in bunraku("import", points, "--names", names, "--out", out, status=2).err
    assert not out.exists()


def imported(folder: Path, points: Array, names: Sequence[str], **options: Any) -> tuple[Recording, str]:
    """Points through a file: the dance, and what is said."""
    np.save(folder / "points.npy", points)
    (folder / "names.txt").write_text("\n".join(names))
    found = import_points(folder / "points.npy", PointsOptions(folder / "names.txt", **options))
    return found.recording, "\n".join(said)


def test_a_point_at_zero_for_a_while_was_not_seen(tmp_path: Path) -> None:
    meant = moved(body(), seconds=2.0)
    points, hand, foot = points_of(meant), meant.skeleton.index("LeftHand"), meant.skeleton.index("RightFoot")
    holed = points.copy()
    holed[20:26, hand] = 0.0
    holed[40:90, foot] = 0.0
    holed[50] = np.where(np.arange(len(meant.skeleton))[:, None] == 3, 0.0, holed[50])
    found, said = imported(tmp_path, holed, meant.skeleton.names)
    assert "LeftHand is 0, 0, 0 in frames 20 to 25: taken as not seen." in said
    assert "UpperChest is 0, 0, 0 in frame 50: taken as not seen." in said
    assert "Gaps: 2 of up to 0.12 s" in said and "LeftHand in frames 20 to 25" in said
    assert "RightFoot in frames 40 to 89 was not seen for 1.00 s, from 0.80 s on" in said
    apart = np.linalg.norm(points_of(found) - points, axis=-1)
    assert apart[:, hand].max() < 0.03


def test_a_root_that_is_the_origin_stays_there_and_any_other_point_was_never_seen(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    centred = points_of(meant) - points_of(meant)[:, :1]
    found, said = imported(tmp_path, centred, meant.skeleton.names)
    assert "0, 0, 0" not in said and "Gaps" not in said
    np.testing.assert_allclose(found.roots, 0.0, atol=1e-9)
    unseen = points_of(meant)
    unseen[:, meant.skeleton.index("LeftHand")] = 0.0
    with pytest.raises(ExchangeError, match="LeftHand: never seen"):
        imported(tmp_path, unseen, meant.skeleton.names)


def test_a_root_that_sets_out_from_the_origin_is_there(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    points = points_of(meant) - points_of(meant)[:1, :1]
    assert (points[0, 0] == 0.0).all()
    assert "0, 0, 0" not in imported(tmp_path, points, meant.skeleton.names)[1]


def test_many_zeros_are_counted_after_some(tmp_path: Path) -> None:
    meant = moved(body(), seconds=2.0)
    holed = points_of(meant)
    for first in range(10, 85, 5):
        holed[first : first + 2, 7] = 0.0
    said = imported(tmp_path, holed, meant.skeleton.names)[1]
    assert said.count("taken as not seen") == 10 and "And 5 more such points and times." in said


def test_a_bone_whose_ends_were_never_seen_together_has_a_length(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    hand = meant.skeleton.index("LeftHand")
    holed = points_of(meant)
    holed[:25, hand], holed[25:, meant.skeleton.parents[hand]] = np.nan, np.nan
    found = imported(tmp_path, holed, meant.skeleton.names)[0]
    assert np.isfinite(found.poses).all() and 0 < np.linalg.norm(found.skeleton.offsets[hand]) < 1


def test_infinite_places_are_gaps(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    holed = points_of(meant)
    holed[5:8, 7] = np.inf
    assert "Gaps: 1 of up to 0.06 s" in imported(tmp_path, holed, meant.skeleton.names)[1]


def table_of(points: Array, names: Sequence[str], kind: str) -> str:
    """Points as programs and spreadsheets write them."""
    rows = [[f"{value:.6f}" for value in row] for row in points.reshape(len(points), -1).tolist()]
    between, axes = {"underscores": ("_", "XYZ"), "capitals": ("", "XYZ")}.get(kind, (".", "xyz"))
    titles = [f"{name}{between}{axis}" for name in names for axis in axes]
    if kind == "semicolons":
        rows = [[word.replace(".", ",") for word in row] for row in rows]
    if kind == "quoted commas":
        rows = [[f'"{word.replace(".", ",")}"' for word in row] for row in rows]
    if kind == "index":
        titles, rows = ["", *titles], [[str(number), *row] for number, row in enumerate(rows)]
    if kind == "frame and time":
        titles = ["Frame", "Time (Seconds)", *titles]
        rows = [[str(number + 1), f"{number / 25:.4f}", *row] for number, row in enumerate(rows)]
    if kind == "NA":
        rows[3][3:6], rows[4][3:6] = ["NA"] * 3, ["NaN", "#N/A", "null"]
    if kind == "tabs and gaps":
        rows[3][-3:], rows[4][-3:] = [""] * 3, [""] * 3
    if kind == "a row cut":
        rows[-1] = rows[-1][:4]
    if kind == "words in a row":
        rows[4][2] = "lost"
    mark = {"semicolons": ";", "tabs": "\t", "tabs and gaps": "\t"}.get(kind, ",")
    end = "\n\n  \n" if kind == "blank last lines" else "\n"
    comment = "# of a tracker\n" if kind == "a comment" else ""
    return comment + "\n".join(mark.join(row) for row in [titles, *rows]) + end


TABLES = {
    "plain": "", "underscores": "", "capitals": "", "semicolons": "", "tabs": "", "quoted commas": "",
    "index": "", "frame and time": "Rate: 25 frames a second, by the column of times", "blank last lines": "",
    "NA": "Gaps: 1 of up to 0.04 s", "tabs and gaps": "Gaps: 1 of up to 0.04 s",
    "a comment": "", "a row cut": "line 51: 1 row lost (this line has 4",
    "words in a row": "'lost' is not a number",
}  # fmt: skip


@pytest.mark.parametrize("kind", TABLES)
def test_tables_as_programs_write_them_are_read(kind: str, tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    points = points_of(meant)
    (tmp_path / "points.csv").write_text(table_of(points, meant.skeleton.names, kind))
    found = import_points(tmp_path / "points.csv", PointsOptions()).recording
    assert found.skeleton.names == meant.skeleton.names
    assert found.fps == (25.0 if kind == "frame and time" else 50.0)
    assert TABLES[kind] in "\n".join(said)
    seen = len(meant) - (kind == "a row cut")
    assert len(found) == seen
    assert np.linalg.norm(points_of(found) - points[:seen], axis=-1).max() < 0.03


def test_names_and_a_rate_that_are_given_apply_before_those_of_the_table_are_judged(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    text = table_of(points_of(meant), ["marker"] * len(meant.skeleton), "frame and time")
    (tmp_path / "points.csv").write_text(text)
    (tmp_path / "names.txt").write_bytes("\n".join(meant.skeleton.names).encode("utf-16"))
    with pytest.raises(ExchangeError, match="Two points have the same name"):
        import_points(tmp_path / "points.csv", PointsOptions())
    options = PointsOptions(tmp_path / "names.txt", fps=100.0)
    assert import_points(tmp_path / "points.csv", options).recording.fps == 100.0


def test_a_first_column_that_counts_is_no_place(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    text = table_of(points_of(meant), meant.skeleton.names, "index")
    (tmp_path / "points.csv").write_text(text.split("\n", 1)[1])
    (tmp_path / "names.txt").write_text("\n".join(meant.skeleton.names))
    found = import_points(tmp_path / "points.csv", PointsOptions(tmp_path / "names.txt"))
    assert found.recording.skeleton.names == meant.skeleton.names
    assert "the first column, which rises evenly" in "".join(said)


def test_prefixes_of_a_performer_say_what_hangs_on_what(tmp_path: Path) -> None:
    meant = moved(body("Actor01_{side}{joint}"), seconds=1.0)
    names = [name if name.startswith("Actor") else f"Actor01_{name}" for name in meant.skeleton.names]
    found, _ = imported(tmp_path, points_of(meant), names)
    assert found.skeleton.parents == meant.skeleton.parents


def test_points_that_the_model_does_not_have_are_named(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    write_bvh(tmp_path / "like.bvh", meant)
    points = np.concatenate([points_of(meant), np.ones((len(meant), 1, 3))], axis=1)
    _, said = imported(tmp_path, points, [*meant.skeleton.names, "Cane"], model=tmp_path / "like.bvh")
    assert "no joints of like.bvh left out: Cane" in said


@pytest.mark.parametrize("ending", [".bvh", ".glb"])
def test_the_model_is_read_as_every_recording_is(tmp_path: Path, ending: str) -> None:
    meant = dance_of("Vicon", seconds=1.0)
    model = tmp_path / f"like{ending}"
    write_recording(model, as_the_system_writes(meant, "Vicon"))
    found, said = imported(tmp_path, points_of(meant), meant.skeleton.names, model=model)
    assert "turned from Z up to Y up" in said
    np.testing.assert_allclose(found.skeleton.offsets, meant.skeleton.offsets, atol=1e-3)
