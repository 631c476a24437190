"""`bunraku convert`: every format gives the same dance back, and other programs read what we write."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.formats import ENDINGS, write_recording
from appliance.exchange.glb_file import GlbBuffer, GlbFile
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.plain_names import plain_names
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.pose.stage_frame import in_stage_frame
from appliance.studio.exchange.reading import read_as_given
from tests.bundles import swaying_phrase
from tests.command import Command
from tests.pose.conventions import dance_of
from tests.pose.test_bvh import HOSTILE
from tests.studio.bodies import body, moved

CLOSE_DEGREES = {".bvh": 1e-3, ".glb": 1e-3, ".npz": 1e-5, ".csv": 1e-4}
CLOSE_M = {".bvh": 1e-6, ".glb": 1e-5, ".npz": 1e-12, ".csv": 1e-8}
AS_IT_IS = ReadingOptions(facing={"*": "z"}, up={"*": "y"})
FIGURES = {
    "22 joints": body(),
    "fingers": body("mixamorig:{side}{joint}", fingers=2),
    "small": swaying_phrase().skeleton,
}


def with_ends(recording: Recording) -> Recording:
    figure = recording.skeleton
    leaves = [joint for joint in range(len(figure)) if joint not in figure.parents]
    ends = tuple((joint, (0.01, 0.05, 0.02)) for joint in leaves)
    return replace(recording, skeleton=replace(figure, ends=ends))


def assert_same_dance(found: Recording, meant: Recording, ending: str) -> None:
    assert found.skeleton.same_joints(meant.skeleton)
    assert found.fps == pytest.approx(meant.fps, rel=1e-6)
    assert found.poses.shape == meant.poses.shape
    apart = np.degrees(quaternion.angle_between(found.poses, meant.poses))
    assert apart.max() < CLOSE_DEGREES[ending]
    np.testing.assert_allclose(found.roots, meant.roots, atol=CLOSE_M[ending])
    np.testing.assert_allclose(found.skeleton.offsets, meant.skeleton.offsets, atol=CLOSE_M[ending])
    assert [joint for joint, _ in found.skeleton.ends] == [joint for joint, _ in meant.skeleton.ends]
    for (_, a), (_, b) in zip(found.skeleton.ends, meant.skeleton.ends, strict=True):
        np.testing.assert_allclose(a, b, atol=CLOSE_M[ending])


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("figure", FIGURES)
def test_a_dance_comes_back(figure: str, ending: str, tmp_path: Path) -> None:
    meant = with_ends(moved(FIGURES[figure], seconds=2.0, fps=59.94))
    write_recording(tmp_path / f"dance{ending}", meant)
    assert_same_dance(read_as_given(tmp_path / f"dance{ending}")[0], meant, ending)


@pytest.mark.parametrize("ending", ENDINGS)
def test_bones_that_stretch_come_back(ending: str, tmp_path: Path) -> None:
    rigid = moved(body(), seconds=1.0)
    count = len(rigid)
    stretched = np.tile(rigid.skeleton.offsets, (count, 1, 1))
    stretched[:, 3] *= 1.0 + 0.2 * np.sin(np.arange(count) / 9)[:, None]
    stretched[:, 0] = 0.0
    write_recording(tmp_path / f"dance{ending}", replace(rigid, translations=stretched))
    found = read_as_given(tmp_path / f"dance{ending}")[0].translations
    assert found is not None
    np.testing.assert_allclose(found[:, 1:], stretched[:, 1:], atol=1e-5)


@settings(deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    frames=st.integers(2, 40),
    fps=st.sampled_from([24.0, 29.97, 30.0, 50.0, 120.0]),
    ending=st.sampled_from([".bvh", ".npz", ".csv"]),
)
def test_any_rotations_come_back(
    seed: int, frames: int, fps: float, ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rng = np.random.default_rng(seed)
    figure = body()
    poses = quaternion.continuous(quaternion.normalize(rng.normal(size=(frames, len(figure), 4))))
    meant = Recording(figure, poses, rng.normal(size=(frames, 3)), fps)
    path = tmp_path_factory.mktemp("any") / f"dance{ending}"
    write_recording(path, meant)
    found = read_as_given(path, AS_IT_IS)[0]
    # Euler angles with six digits: at gimbal lock they say less
    assert np.degrees(quaternion.angle_between(found.poses, meant.poses)).max() < 0.01
    assert found.fps == pytest.approx(fps, rel=1e-6)


def test_the_chain_of_all_formats_ends_where_it_began(tmp_path: Path, bunraku: Command) -> None:
    meant = moved(body(), seconds=1.0)
    write_bvh(tmp_path / "a.bvh", meant)
    for source, out in (("a.bvh", "b.glb"), ("b.glb", "c.csv"), ("c.csv", "d.npz"), ("d.npz", "e.bvh")):
        assert (
            "50 poses at 50 a second, 22 joints" in bunraku("convert", tmp_path / source, tmp_path / out).out
        )
    assert_same_dance(read_bvh(tmp_path / "e.bvh"), meant, ".bvh")


def test_real_dances_come_back(recordings_dir: Path, tmp_path: Path) -> None:
    path = next(recordings_dir.glob("**/salsa_18.bvh"))
    meant = read_bvh(path, true_fps=60, drop_tpose=True).excerpt(0.0, 5.0)
    for ending in ENDINGS:
        write_recording(tmp_path / f"dance{ending}", meant)
        assert_same_dance(read_as_given(tmp_path / f"dance{ending}", AS_IT_IS)[0], meant, ending)


def test_the_command_as_it_is_installed(tmp_path: Path) -> None:
    write_bvh(tmp_path / "a.bvh", swaying_phrase())
    command = [
        sys.executable,
        "-m",
        "appliance.cli",
        "convert",
        str(tmp_path / "a.bvh"),
        str(tmp_path / "b.csv"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = (tmp_path / "b.csv").read_text().splitlines()
    assert lines[1].startswith("time,root.x,root.y,root.z,Hips.w,Hips.x,Hips.y,Hips.z,")
    assert len(lines) == 2 + len(swaying_phrase())


def test_another_rate(tmp_path: Path, bunraku: Command) -> None:
    write_bvh(tmp_path / "a.bvh", swaying_phrase())
    bunraku("convert", tmp_path / "a.bvh", tmp_path / "b.npz", "--fps", "25")
    assert np.load(tmp_path / "b.npz")["fps"] == 25


def test_an_independent_reader_sees_figure_and_body(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: make test brings it")
    meant = moved(body(), seconds=1.0)
    write_recording(tmp_path / "dance.glb", meant)
    scene = trimesh.load(tmp_path / "dance.glb")
    places, _ = meant.skeleton.forward_kinematics(meant.poses[0], meant.roots[0])
    for name, place in zip(meant.skeleton.names, places, strict=True):
        matrix, _ = scene.graph.get(name)
        np.testing.assert_allclose(matrix[:3, 3], place, atol=1e-5)
    (mesh,) = scene.geometry.values()
    assert mesh.is_watertight
    assert 1.2 < np.ptp(mesh.vertices, axis=0).max() < 2.2


def test_every_vertex_of_the_body_is_moved_by_joints_as_the_projector_moves_it(tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    write_recording(tmp_path / "dance.glb", meant)
    file = GlbFile(tmp_path / "dance.glb")
    (skin,), (mesh,) = file.document["skins"], file.document["meshes"]
    attributes = mesh["primitives"][0]["attributes"]
    weights, joints = file.array(attributes["WEIGHTS_0"]), file.array(attributes["JOINTS_0"]).astype(int)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-5)
    assert joints.max() < len(skin["joints"])
    # bound: the inverse bind matrix brings each joint's own place to the origin, so a body at rest stays
    rest = np.tile(quaternion.IDENTITY.astype(float), (len(meant.skeleton), 1))
    places, _ = meant.skeleton.forward_kinematics(rest, np.zeros(3))
    inverse = np.swapaxes(file.array(skin["inverseBindMatrices"]), 1, 2)
    at_origin = np.einsum("jab,jb->ja", inverse, np.c_[places, np.ones(len(places))])[:, :3]
    np.testing.assert_allclose(at_origin, 0.0, atol=1e-5)


def test_a_file_of_blender_s_kind(tmp_path: Path) -> None:
    """An armature in centimetres above the root, Z up below it, keys at uneven times, a still joint."""
    turn = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
    buffer = GlbBuffer()
    times = buffer.add(np.array([0.0, 0.5, 1.0], np.float32), bounds=True)
    swing = buffer.add(np.array([[0, 0, 0, 1], [0, 0, 0.6, 0.8], [0, 0, 0, 1]], np.float32))
    buffer.write(
        tmp_path / "foreign.glb",
        {
            "asset": {"version": "2.0"},
            "nodes": [
                {"name": "Armature", "rotation": turn, "scale": [0.01] * 3, "children": [1]},
                {"name": "Hips", "translation": [0, 0, 95], "children": [2]},
                {"name": "Spine", "translation": [0, 0, 20]},
            ],
            "skins": [{"joints": [1, 2]}],
            "animations": [
                {
                    "samplers": [{"input": times, "output": swing}],
                    "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
                }
            ],
        },
    )
    found = read_as_given(tmp_path / "foreign.glb")[0]
    assert found.skeleton.names == ("Hips", "Spine")
    np.testing.assert_allclose(found.roots, np.tile([0.0, 0.95, 0.0], (3, 1)), atol=1e-6)
    places, _ = found.skeleton.forward_kinematics(found.poses, found.roots)
    np.testing.assert_allclose(places[:, 1], np.tile([0.0, 1.15, 0.0], (3, 1)), atol=1e-6)
    assert found.fps == 2.0
    np.testing.assert_allclose(found.poses[1, 1], [0.8, 0.0, 0.0, 0.6], atol=1e-6)


def damaged_glb(data: bytes) -> bytes:
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    for accessor in document["accessors"]:
        accessor["count"] = 1 << 40
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest


@pytest.mark.parametrize("ending", [".glb", ".npz", ".csv"])
def test_damaged_files_are_refused_in_words(ending: str, tmp_path: Path, bunraku: Command) -> None:
    path = tmp_path / f"dance{ending}"
    write_recording(path, swaying_phrase())
    whole = path.read_bytes()
    spoilt = [b"", b"hello", whole[: len(whole) // 2], whole[:40], whole[:100] + b"\xff" * 50 + whole[150:]]
    if ending == ".glb":
        spoilt.append(damaged_glb(whole))
    for data in spoilt[:3] + spoilt[5:]:
        path.write_bytes(data)
        if ending == ".csv" and data == spoilt[2]:
            continue  # half a table may end between two rows
        assert f"dance{ending}:" in bunraku("convert", path, tmp_path / "out.bvh", status=2).err
    for data in spoilt[3:5]:
        path.write_bytes(data)
        with pytest.raises(ExchangeError):
            read_as_given(path)[0]
    assert not (tmp_path / "out.bvh").exists() or ending == ".csv"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "1,2",
            "line 7: 1 row lost (this line has 2 values, the others 36), the figure turns evenly over it",
        ),
        ("x{row}", "'x0.08' is not a number"),
        ("NA{row}", "is not a number"),
        ("{row},7", "has 37 values"),
    ],
)
def test_a_row_that_is_none_costs_that_row_and_is_named(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "dance.csv"
    write_recording(path, swaying_phrase())
    lines = path.read_text().splitlines()
    lines[6] = text.format(row=lines[6])
    path.write_text("\n".join(lines))
    found, guesses = read_as_given(path)
    assert len(found) == len(swaying_phrase())
    assert message in guesses[0].sentence() and "line 7" in guesses[0].sentence()


def test_a_table_without_one_whole_row_is_refused_with_its_line(tmp_path: Path, bunraku: Command) -> None:
    path = tmp_path / "dance.csv"
    write_recording(path, swaying_phrase())
    path.write_text("\n".join([*path.read_text().splitlines()[:2], "1,2", "x"]))
    said = bunraku("convert", path, tmp_path / "out.bvh", status=2).err
    assert "dance.csv:3: This line has 2 values" in said


@pytest.mark.parametrize("ending", [".npz", ".csv"])
def test_frames_that_are_no_rotations_are_lost_and_named(ending: str, tmp_path: Path) -> None:
    meant = moved(body(), seconds=1.0)
    poses = meant.poses.copy()
    poses[10:12, 3], poses[-1, 0] = np.nan, 0.0
    write_recording(tmp_path / f"dance{ending}", replace(meant, poses=poses))
    found, guesses = read_as_given(tmp_path / f"dance{ending}")
    assert len(found) == len(meant) - 1
    place = "lines 13 to 14" if ending == ".csv" else "frames 10 to 11"
    assert f"{place}: 2 " in guesses[0].message and "is no unit quaternion" in guesses[0].message
    assert "1 " in guesses[1].message and "left out" in guesses[1].message
    apart = np.degrees(quaternion.angle_between(found.poses, meant.poses[:-1]))
    assert apart.max() < 3.0


def in_a_spreadsheet(text: str, kind: str) -> str:
    """As a spreadsheet saves the table."""
    head, titles, *rows = text.splitlines()
    if kind == "semicolons":
        first = '"' + head.replace('"', '""') + '"' + ";" * titles.count(",")
        return "\n".join(
            [first, titles.replace(",", ";"), *(r.replace(",", ";").replace(".", ",") for r in rows)]
        )
    if kind == "index":
        return "\n".join([head, f",{titles}", *(f"{number},{row}" for number, row in enumerate(rows))])
    if kind == "another order":
        turned = [",".join(reversed(row.split(","))) for row in (titles, *rows)]
        return "\n".join([head, *turned])
    return "\r\n".join([head, titles, *rows, "", "  ", ""])


@pytest.mark.parametrize("kind", ["semicolons", "index", "another order", "blank last lines"])
def test_what_spreadsheets_make_of_a_table_is_read(kind: str, tmp_path: Path) -> None:
    meant, path = moved(body(), seconds=1.0), tmp_path / "dance.csv"
    write_recording(path, meant)
    path.write_text(in_a_spreadsheet(path.read_text(), kind))
    found, guesses = read_as_given(path)
    assert_same_dance(found, meant, ".csv")
    assert [guess.message for guess in guesses] == (
        ["columns that are none of the skeleton left out: one without a title"] if kind == "index" else []
    )


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_true_rate_overrules_the_one_of_every_format(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"dance{ending}"
    write_recording(path, swaying_phrase())
    found, _ = read_as_given(path, ReadingOptions(true_fps={"*": 25.0}))
    assert found.fps == 25.0 and len(found) == len(swaying_phrase())


def test_the_true_rate_applies_before_a_table_s_own_is_judged(tmp_path: Path) -> None:
    path = tmp_path / "dance.csv"
    write_recording(path, swaying_phrase())
    path.write_text(path.read_text().replace('"fps": 50.0', '"fps": 0', 1))
    with pytest.raises(ExchangeError):
        read_as_given(path)
    assert read_as_given(path, ReadingOptions(true_fps={"*": 25.0}))[0].fps == 25.0


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_format_is_turned_to_the_audience_unless_asked(ending: str, tmp_path: Path) -> None:
    meant, _ = in_stage_frame(dance_of("Mixamo", seconds=2.0))
    half = quaternion.from_axis_angle([0.0, 1.0, 0.0], np.pi)
    away = replace(meant, poses=meant.poses.copy(), roots=meant.roots * [-1.0, 1.0, -1.0])
    away.poses[:, 0] = quaternion.multiply(half, meant.poses[:, 0])
    write_recording(tmp_path / f"dance{ending}", away)
    found, guesses = read_as_given(tmp_path / f"dance{ending}")
    assert_same_dance(found, meant, ending)
    assert "mostly faces -z, turned to the audience (otherwise: --facing z)" in guesses[-1].sentence()
    assert_same_dance(read_as_given(tmp_path / f"dance{ending}", AS_IT_IS)[0], away, ending)


@pytest.mark.parametrize("ending", ENDINGS)
def test_whatever_joints_are_called_what_is_written_is_read_back(ending: str, tmp_path: Path) -> None:
    count = len(HOSTILE)
    skeleton = Skeleton(HOSTILE, (-1, *range(count - 1)), np.tile([0.0, 0.1, 0.0], (count, 1)))
    poses = np.tile(quaternion.IDENTITY.astype(float), (3, count, 1))
    changed = write_recording(tmp_path / f"dance{ending}", Recording(skeleton, poses, np.zeros((3, 3)), 50.0))
    found, _ = read_as_given(tmp_path / f"dance{ending}", AS_IT_IS)
    assert found.skeleton.names == plain_names(HOSTILE)
    assert "'line\\nend' to 'line_end'" in changed and "左ひざ" not in changed


def test_what_cannot_be_converted_is_said_before_any_work(tmp_path: Path, bunraku: Command) -> None:
    write_bvh(tmp_path / "a.bvh", swaying_phrase())
    assert "Known: .bvh, .glb" in bunraku("convert", tmp_path / "a.bvh", tmp_path / "b.fbx", status=2).err
    assert "cannot be read" in bunraku("convert", tmp_path / "no.npz", tmp_path / "b.bvh", status=2).err
    (tmp_path / "file").write_text("")
    said = bunraku("convert", tmp_path / "a.bvh", tmp_path / "file" / "b.npz", status=2).err
    assert "cannot be written" in said
