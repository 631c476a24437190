"""BVH files in and out: every honest way to write one."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.plain_names import plain_names
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

LEG = """HIERARCHY
ROOT hip
{
  OFFSET 7 8 9
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT knee
  {
    OFFSET 0 -40 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -42 1
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.02
0 90 0 0 0 0 0 0 0
10 91 5 10 20 30 40 50 60
"""


@pytest.fixture
def leg(tmp_path: Path) -> Path:
    path = tmp_path / "leg.bvh"
    path.write_text(LEG)
    return path


def rewritten(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def turn(axes: str, *degrees: float) -> np.ndarray:
    """The rotation as a product of single turns, written out."""
    result = np.eye(3)
    for axis, angle in zip(axes, np.radians(degrees), strict=True):
        result = result @ quaternion.to_matrix(
            quaternion.from_axis_angle(np.eye(3)["xyz".index(axis)], angle)
        )
    return result


def test_a_file_is_read_into_metres_and_rotations(leg: Path) -> None:
    recording = read_bvh(leg)
    assert recording.skeleton.names == ("hip", "knee")
    assert recording.skeleton.parents == (-1, 0)
    assert recording.skeleton.ends == ((1, (0.0, -0.42, 0.01)),)
    assert recording.fps == 50
    assert recording.translations is None
    np.testing.assert_allclose(recording.skeleton.offsets, [[0, 0, 0], [0, -0.4, 0]])
    np.testing.assert_allclose(recording.roots, [[0, 0.9, 0], [0.1, 0.91, 0.05]])
    matrices = quaternion.to_matrix(recording.poses[1])
    np.testing.assert_allclose(matrices, [turn("zyx", 10, 20, 30), turn("zxy", 40, 50, 60)], atol=1e-12)


def test_the_root_stands_where_its_channels_say_not_at_its_offset(leg: Path) -> None:
    positions, _ = (r := read_bvh(leg)).skeleton.forward_kinematics(r.poses, r.roots)
    np.testing.assert_allclose(positions[0], [[0, 0.9, 0], [0, 0.5, 0]], atol=1e-12)


@pytest.mark.parametrize("order", list(permutations("XYZ")), ids="".join)
def test_any_order_of_rotation_channels(leg: Path, order: tuple[str, ...]) -> None:
    channels = " ".join(f"{axis}rotation" for axis in order)
    rewritten(leg, "CHANNELS 3 Zrotation Xrotation Yrotation", f"CHANNELS 3 {channels}")
    matrix = quaternion.to_matrix(read_bvh(leg).poses[1, 1])
    np.testing.assert_allclose(matrix, turn("".join(order).lower(), 40, 50, 60), atol=1e-12)


def test_rotations_before_positions_and_axes_mixed(leg: Path) -> None:
    rewritten(
        leg,
        "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation",
        "CHANNELS 6 Zrotation Zposition Yrotation Xposition Xrotation Yposition",
    )
    rewritten(leg, "10 91 5 10 20 30", "10 5 20 10 30 91")
    recording = read_bvh(leg)
    np.testing.assert_allclose(recording.roots[1], [0.1, 0.91, 0.05])
    np.testing.assert_allclose(
        quaternion.to_matrix(recording.poses[1, 0]), turn("zyx", 10, 20, 30), atol=1e-12
    )


@pytest.mark.parametrize(
    ("channels", "values"), [("1 Xrotation", "30"), ("0", ""), ("2 Yrotation Zrotation", "5 6")]
)
def test_joints_with_fewer_channels(leg: Path, channels: str, values: str) -> None:
    rewritten(leg, "CHANNELS 3 Zrotation Xrotation Yrotation", f"CHANNELS {channels}")
    rewritten(leg, "0 90 0 0 0 0 0 0 0", f"0 90 0 0 0 0 {values}")
    rewritten(leg, "40 50 60", values)
    axes = "".join(word[0].lower() for word in channels.split()[1:])
    degrees = [float(v) for v in values.split()]
    matrix = quaternion.to_matrix(read_bvh(leg).poses[1, 1])
    np.testing.assert_allclose(matrix, turn(axes, *degrees), atol=1e-12)


def test_position_channels_replace_an_offset_and_stretch_the_bone(leg: Path) -> None:
    rewritten(leg, "CHANNELS 3 Zrotation Xrotation", "CHANNELS 5 Yposition Xposition Zrotation Xrotation")
    rewritten(leg, "0 90 0 0 0 0 0 0 0", "0 90 0 0 0 0 -30 2 0 0 0")
    rewritten(leg, "40 50 60", "-45 3 40 50 60")
    recording = read_bvh(leg)
    assert recording.translations is not None
    np.testing.assert_allclose(recording.translations[:, 1], [[0.02, -0.3, 0], [0.03, -0.45, 0]])
    positions, _ = recording.skeleton.forward_kinematics(
        recording.poses, recording.roots, recording.translations
    )
    np.testing.assert_allclose(positions[0, 1], [0.02, 0.6, 0], atol=1e-12)
    reach = np.linalg.norm(positions[:, 1] - positions[:, 0], axis=-1)
    np.testing.assert_allclose(reach, np.hypot([0.02, 0.03], [0.3, 0.45]), atol=1e-12)


def test_position_channels_that_never_change_are_an_offset(leg: Path) -> None:
    rewritten(leg, "CHANNELS 3 Zrotation Xrotation", "CHANNELS 4 Yposition Zrotation Xrotation")
    rewritten(leg, "0 90 0 0 0 0 0 0 0", "0 90 0 0 0 0 -33 0 0 0")
    rewritten(leg, "40 50 60", "-33 40 50 60")
    recording = read_bvh(leg)
    assert recording.translations is None
    np.testing.assert_allclose(recording.skeleton.offsets[1], [0, -0.33, 0])


def test_the_rate_of_the_header_can_be_corrected(leg: Path) -> None:
    assert read_bvh(leg, true_fps=60).fps == 60


def test_units_can_be_told(leg: Path) -> None:
    recording = read_bvh(leg, metres_per_unit=0.0254)
    np.testing.assert_allclose(recording.skeleton.offsets[1], [0, -40 * 0.0254, 0])
    np.testing.assert_allclose(recording.roots[1], np.array([10, 91, 5]) * 0.0254)


def spellings() -> dict[str, bytes]:
    upper = LEG.upper().replace("HIP", "hip").replace("KNEE", "knee")
    return {
        "crlf": LEG.replace("\n", "\r\n").encode(),
        "old mac": LEG.replace("\n", "\r").encode(),
        "byte order mark": b"\xef\xbb\xbf" + LEG.encode(),
        "tabs": LEG.replace("  ", "\t").replace(" ", "\t").replace("End\tSite", "End Site").encode(),
        "odd case": upper.encode(),
        "lower case": LEG.lower().encode(),
        "blank lines": LEG.replace("\n", "\n\n  \n").encode(),
        "no newline at the end": LEG.rstrip().encode(),
        "spaces at line ends": LEG.replace("\n", "   \n").encode(),
        "braces on the line before": LEG.replace("hip\n{", "hip {").replace("Site\n    {", "Site {").encode(),
        "brace touching the name": LEG.replace("knee\n  {", "knee{").encode(),
        "no space after the colon": LEG.replace("Frames: 2", "Frames:2").replace("Time: ", "Time:").encode(),
        "utf-16": LEG.encode("utf-16"),
        "decimal commas": LEG.replace("0.02", "0,02").replace(" 5 10 ", " 5,0 10,00 ").encode(),
        "exponents": LEG.replace("10 91 5", "1e1 9.1E+1 +5.0").encode(),
    }


@pytest.mark.parametrize("spelling", spellings())
def test_every_spelling_of_the_same_file(tmp_path: Path, leg: Path, spelling: str) -> None:
    path = tmp_path / "other.bvh"
    path.write_bytes(spellings()[spelling])
    read, expected = read_bvh(path), read_bvh(leg)
    assert read.skeleton.same_joints(expected.skeleton)
    np.testing.assert_array_equal(read.poses, expected.poses)
    np.testing.assert_array_equal(read.roots, expected.roots)


def test_names_may_contain_spaces_and_any_script(leg: Path) -> None:
    leg.write_text(LEG.replace("JOINT knee", "JOINT 左 膝"), encoding="utf-8")
    assert read_bvh(leg).skeleton.names == ("hip", "左 膝")


@pytest.mark.parametrize("encoding", ["utf-8", "cp932"])
def test_names_in_shift_jis_are_read_as_they_were_written(leg: Path, encoding: str) -> None:
    leg.write_bytes(LEG.replace("hip", "センター").replace("knee", "左ひざ").encode(encoding))
    assert read_bvh(leg).skeleton.names == ("センター", "左ひざ")


def test_an_umlaut_of_a_latin_encoding_is_no_kanji(leg: Path) -> None:
    leg.write_bytes(LEG.replace("hip", "Hüfte").replace("knee", "Schädel").encode("cp1252"))
    assert read_bvh(leg).skeleton.names == ("Hüfte", "Schädel")


def test_a_damaged_byte_does_not_change_the_encoding(leg: Path) -> None:
    text = LEG.replace("hip", "センター").replace("knee", "左ひざ").encode()
    leg.write_bytes(text.replace(b"10 91", b"10 \xff91"))
    assert read_bvh(leg).skeleton.names == ("センター", "左ひざ")


@pytest.mark.parametrize(
    ("said", "fps"),
    [("30", 30), ("29.97", 29.97), ("120", 120), ("16.6667", 60), ("8,33333", 120), ("20", 50), ("1", 1)],
)
def test_a_frame_time_that_is_a_rate_or_in_milliseconds_is_read_so_and_said(
    leg: Path, said: str, fps: float
) -> None:
    recording = read_bvh(rewritten(leg, "Frame Time: 0.02", f"Frame Time: {said}"))
    assert recording.fps == pytest.approx(fps, rel=1e-4)
    assert ("--true-fps" in "".join(recording.notes)) == (fps != 1)


@pytest.mark.parametrize("said", ["0", "-1", "nan", "soon", "11", "0,02", "", "30"])
def test_the_true_rate_applies_before_the_header_s_is_judged(leg: Path, said: str) -> None:
    assert read_bvh(rewritten(leg, "Frame Time: 0.02", f"Frame Time: {said}"), true_fps=60).fps == 60


def test_the_true_rate_also_stands_for_a_line_that_is_missing(leg: Path) -> None:
    assert len(read_bvh(rewritten(leg, "Frame Time: 0.02\n", ""), true_fps=60)) == 2


SIX = ("CHANNELS 3 Zrotation", "CHANNELS 6 Xposition Yposition Zposition Zrotation")


@pytest.mark.parametrize(
    ("first", "second", "offset_m"),
    [
        ("0 0 0", "0 0 0", (0.0, -0.4, 0.0)),  # never written
        ("0 0 0", "1 -2 0", (0.0, -0.4, 0.0)),  # changes of the OFFSET
        ("0 -41 0", "1 -39 0", (0.0, -0.41, 0.0)),  # in place of it
    ],
)
def test_positions_near_zero_are_changes_of_the_offset(
    leg: Path, first: str, second: str, offset_m: tuple[float, ...]
) -> None:
    rewritten(leg, *SIX)
    rewritten(leg, "0 90 0 0 0 0 0 0 0", f"0 90 0 0 0 0 {first} 0 0 0")
    rewritten(leg, "40 50 60", f"{second} 40 50 60")
    recording = read_bvh(leg)
    np.testing.assert_allclose(recording.skeleton.offsets[1], offset_m)
    assert ("added to the OFFSETs" in "".join(recording.notes)) == (offset_m[1] == -0.4)
    if second == "1 -2 0":
        assert recording.translations is not None
        np.testing.assert_allclose(recording.translations[1, 1], [0.01, -0.42, 0.0])


HOSTILE = (
    "line\nend",
    "",
    "{",
    "}",
    "a {",
    "  two   words ",
    "tab\tbed",
    "\ud800",
    "x" * 5000,
    "a_{",
    "",
    "a _",
)
HOSTILE += ("a {", "NUL\0", "\u2028", "joint1", "左ひざ", "OFFSET", "End Site")


def test_whatever_joints_are_called_what_is_written_is_read_back(tmp_path: Path) -> None:
    count = len(HOSTILE)
    skeleton = Skeleton(HOSTILE, (-1, *range(count - 1)), np.tile([0.0, 0.1, 0.0], (count, 1)))
    poses = np.tile(quaternion.IDENTITY.astype(float), (3, count, 1))
    write_bvh(tmp_path / "dance.bvh", Recording(skeleton, poses, np.zeros((3, 3)), 50.0))
    back = read_bvh(tmp_path / "dance.bvh")
    assert back.skeleton.names == plain_names(HOSTILE)
    assert back.skeleton.names[-3:] == HOSTILE[-3:] and len(set(back.skeleton.names)) == count
    assert plain_names(back.skeleton.names) == back.skeleton.names and not back.notes


def a_dance(stretching: bool = False) -> Recording:
    """Eleven joints in the order in which a file lists them, 40 poses, turning past every half turn."""
    generator = np.random.default_rng(6)
    parents = (-1, 0, 1, 2, 1, 4, 0, 6, 7, 0, 9)
    skeleton = Skeleton(
        tuple(f"joint {i}" for i in range(11)),
        parents,
        np.concatenate([np.zeros((1, 3)), generator.normal(size=(10, 3))]),
        ((3, (0.0, 0.1, 0.0)), (5, (0.0, 0.2, 0.0)), (8, (0.1, 0.0, 0.0)), (10, (0.0, 0.0, 0.3))),
    )
    axes, pace = generator.normal(size=(11, 3)), generator.uniform(1, 9, size=11)
    poses = quaternion.from_axis_angle(axes, np.linspace(0, 1, 40)[:, None] * pace)
    translations = skeleton.offsets + generator.normal(scale=0.1, size=(40, 11, 3)) if stretching else None
    return Recording(skeleton, poses, generator.normal(size=(40, 3)), 50.0, translations)


@pytest.mark.parametrize("stretching", [False, True])
def test_what_is_written_comes_back(tmp_path: Path, stretching: bool) -> None:
    dance = a_dance(stretching)
    write_bvh(tmp_path / "dance.bvh", dance)
    back = read_bvh(tmp_path / "dance.bvh")
    assert back.skeleton.same_joints(dance.skeleton)
    assert back.fps == pytest.approx(50)
    assert [joint for joint, _ in back.skeleton.ends] == [joint for joint, _ in dance.skeleton.ends]
    assert quaternion.angle_between(back.poses, dance.poses).max() < 1e-7
    np.testing.assert_allclose(back.roots, dance.roots, atol=1e-8)
    assert (back.translations is None) is not stretching
    for a, b in zip(
        back.skeleton.forward_kinematics(back.poses, back.roots, back.translations),
        dance.skeleton.forward_kinematics(dance.poses, dance.roots, dance.translations),
        strict=True,
    ):
        np.testing.assert_allclose(a, quaternion.aligned(b, a) if a.shape[-1] == 4 else b, atol=1e-6)


def test_poses_are_read_without_sign_jumps(tmp_path: Path) -> None:
    write_bvh(tmp_path / "dance.bvh", a_dance())
    poses = read_bvh(tmp_path / "dance.bvh").poses
    assert (np.sum(poses[1:] * poses[:-1], axis=-1) > 0).all()


def test_a_tpose_is_dropped_on_request_only(leg: Path) -> None:
    rows = "\n".join("0 90 0 0 0 0 80 0 0" for _ in range(20))
    rewritten(leg, "Frames: 2", "Frames: 21")
    rewritten(leg, "10 91 5 10 20 30 40 50 60", rows)
    assert len(read_bvh(leg)) == 21
    assert len(read_bvh(leg, drop_tpose=True)) == 20


def test_a_figure_that_stands_still_is_no_tpose(leg: Path) -> None:
    rewritten(leg, "10 91 5 10 20 30 40 50 60", "0 90 0 0 0 0 0 0 0")
    assert len(read_bvh(leg, drop_tpose=True)) == 2
