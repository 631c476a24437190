"""Pictures: what is near hides what is far, shadows lie below, held joints are in colour."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from appliance.pictures.figure import Frame, floor_shadow, render
from appliance.pictures.filmstrip import VERMILION, Strip, draw_filmstrip, draw_strips, held_throughout
from appliance.pictures.filmstrip_stage import Row, Stage
from appliance.pose import quaternion
from appliance.pose.body import Body, Cones
from appliance.pose.skeleton import Skeleton

FRAME = Frame(100, 80, 50.0, 40.0, 100.0)
RED, BLUE = np.array([1.0, 0.1, 0.1]), np.array([0.1, 0.1, 1.0])


def cones(*shapes: tuple[tuple[float, float, float], tuple[float, float, float], float, float]) -> Cones:
    start, end, first, last = zip(*shapes, strict=True)
    return Cones(np.array(start), np.array(end), np.array(first), np.array(last), np.arange(len(shapes)))


def test_a_ball_covers_a_disc() -> None:
    picture = render(cones(((0, 0, 0), (0, 0, 0), 0.2, 0.2)), RED[None], FRAME)
    assert picture.shape == (80, 100, 4)
    assert picture[..., 3].sum() == pytest.approx(np.pi * 20**2, rel=0.01)
    assert picture[40, 50, 3] == 1
    assert picture[40, 72, 3] == 0


@pytest.mark.parametrize("lean", [0.0, 0.2, -0.3])
def test_a_rounded_cone_covers_both_ends_and_the_trapezium_between(lean: float) -> None:
    picture = render(cones(((-0.25, 0, 0), (0.25, 0, lean), 0.05, 0.15)), RED[None], FRAME)
    across = picture[..., 3].sum(axis=0)
    assert across[25] == pytest.approx(10, abs=1.5)
    assert across[75] == pytest.approx(30, abs=1)
    assert across[50] == pytest.approx((across[25] + across[75]) / 2, abs=2)
    assert (np.flatnonzero(across)[[0, -1]] == [20, 89]).all()


def test_a_cone_seen_end_on_is_its_larger_disc() -> None:
    picture = render(cones(((0, 0, -0.3), (0, 0, 0.3), 0.1, 0.2)), RED[None], FRAME)
    assert picture[..., 3].sum() == pytest.approx(np.pi * 20**2, rel=0.01)


@pytest.mark.parametrize("nearer", [0, 1])
def test_what_is_near_hides_what_is_far(nearer: int) -> None:
    depths = [0.5 if number == nearer else -0.5 for number in (0, 1)]
    pair = cones(*[((0, -0.1, z), (0, 0.1, z), 0.1, 0.1) for z in depths])
    picture = render(pair, np.stack([RED, BLUE]), FRAME)
    red, _, blue, _ = picture[40, 50]
    assert (red > blue) == (nearer == 0)


def test_light_comes_from_above_left() -> None:
    picture = render(cones(((0, 0, 0), (0, 0, 0), 0.3, 0.3)), np.ones((1, 3)), FRAME)[..., :3].sum(axis=-1)
    assert picture[25, 35] > 1.5 * picture[55, 65]


def test_what_lies_outside_the_picture_is_no_harm() -> None:
    assert render(cones(((9, 9, 0), (8, 9, 0), 0.1, 0.1)), RED[None], FRAME).max() == 0


def test_a_shadow_is_dark_and_sharp_below_a_foot_and_faint_below_a_raised_hand() -> None:
    standing = floor_shadow(cones(((0, 0.02, 0), (0.1, 0.02, 0), 0.04, 0.04)), 0.0, 0.5, FRAME)
    raised = floor_shadow(cones(((0, 1.5, 0), (0.1, 1.5, 0), 0.04, 0.04)), 0.0, 0.5, FRAME)
    assert standing.shape == (80, 100)
    assert standing.max() > 0.5 > 2 * raised.max()
    row, column = np.unravel_index(standing.argmax(), standing.shape)
    assert abs(row - 40) < 4
    assert 48 < column < 64
    assert standing[0, 0] == 0


FIGURE = Skeleton(
    ("hip", "chest", "head", "lArm", "lHand", "rArm", "rHand", "lLeg", "lFoot", "rLeg", "rFoot"),
    (-1, 0, 1, 1, 3, 1, 5, 0, 7, 0, 9),
    np.array(
        [
            [0, 0, 0],
            [0, 0.5, 0],
            [0, 0.2, 0],
            [0.2, 0.1, 0],
            [0.5, 0, 0],
            [-0.2, 0.1, 0],
            [-0.5, 0, 0],
            [0.1, -0.4, 0],
            [0, -0.45, 0],
            [-0.1, -0.4, 0],
            [0, -0.45, 0],
        ]
    ),
    ((8, (0.0, 0.0, 0.15)), (10, (0.0, 0.0, 0.15))),
)


def dance(skeleton: Skeleton, frames: int = 60) -> tuple[np.ndarray, np.ndarray]:
    poses = np.tile(quaternion.IDENTITY, (frames, len(skeleton), 1))
    swing = 0.8 * np.sin(np.linspace(0, 6, frames))
    poses[:, -1] = quaternion.from_axis_angle([0, 0, 1], swing)
    poses[:, min(3, len(skeleton) - 1)] = quaternion.from_axis_angle([0, 1, 0], swing)
    return poses, np.tile(np.array([0, 0.9, 0], np.float32), (frames, 1))


def accent_pixels(path: Path) -> int:
    """Pixels whose colour is nearer to the accent than ivory, slate or the stage can be."""
    picture = matplotlib.image.imread(path)[..., :3]
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    assert VERMILION.argmax() == 0
    return int(((red > 0.4) & (red > 2.5 * green) & (red > 2.5 * blue)).sum())


def test_held_joints_are_in_colour_and_nothing_else_is(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    plain = draw_filmstrip(tmp_path / "deep" / "plain.png", FIGURE, poses, roots, 50, columns=3, rows=1)
    holds = held_throughout(poses, [3])
    held = draw_filmstrip(tmp_path / "held.png", FIGURE, poses, roots, 50, holds, columns=3, rows=1)
    assert plain == tmp_path / "deep" / "plain.png"
    assert plain.read_bytes().startswith(b"\x89PNG")
    assert accent_pixels(plain) == 0
    assert accent_pixels(held) > 500


def test_the_colour_follows_how_firmly_a_joint_is_held(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    nobody = held_throughout(poses, [])
    pictures = {
        weight: draw_filmstrip(
            tmp_path / f"{weight}.png",
            FIGURE,
            poses,
            roots,
            50,
            weight * held_throughout(poses, [3]),
            columns=3,
        )
        for weight in (0.0, 0.3, 1.0)
    }
    unheld = draw_filmstrip(tmp_path / "nobody.png", FIGURE, poses, roots, 50, nobody, columns=3)
    assert pictures[0.0].read_bytes() == unheld.read_bytes()
    assert accent_pixels(pictures[0.0]) == 0, "no figure, trail or legend in the colour of hands"
    assert accent_pixels(pictures[0.3]) < 0.5 * accent_pixels(pictures[1.0])


def test_a_trail_begins_and_ends_with_the_hold(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    holds = held_throughout(poses, [3])
    holds[:40] = 0.0
    stage = Stage(FIGURE, [Row(poses, roots, np.array([20, 59]), holds=holds)], 50)
    ((_, weights),) = stage.trails
    assert weights.tolist() == holds[29:60, 3].tolist()


def size(path: Path) -> tuple[int, int]:
    height, width = matplotlib.image.imread(path).shape[:2]
    return height, width


def test_rows_and_columns_give_the_size(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    small, wide, tall = (
        size(draw_filmstrip(tmp_path / f"{c}{r}.png", FIGURE, poses, roots, 50, columns=c, rows=r))
        for c, r in ((3, 1), (5, 1), (3, 2))
    )
    assert wide[1] > small[1]
    assert wide[0] == small[0]
    assert tall[0] > 1.5 * small[0]


def test_original_and_reconstruction_stand_one_above_the_other(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    picture = draw_filmstrip(tmp_path / "two.png", FIGURE, poses, roots, 50, columns=3, against=poses)
    assert size(picture)[0] > 700


def test_strips_stand_under_each_other_with_ghosts_behind_them(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    still = np.tile(quaternion.IDENTITY, (len(poses), len(FIGURE), 1))
    dancing = Strip(poses, roots, "dancing")
    alone = [dancing, dancing, dancing]
    pictures = [
        matplotlib.image.imread(draw_strips(tmp_path / f"{number}.png", FIGURE, strips, 50, columns=3))
        for number, strips in enumerate((alone, [*alone[:2], replace(dancing, behind=Strip(still, roots))]))
    ]
    changed = np.abs(pictures[0] - pictures[1]).max(axis=(1, 2)) > 0.05
    assert changed[-len(changed) // 3 :].any() and not changed[: len(changed) // 2].any()
    with pytest.raises(ValueError, match="at least one pose"):
        draw_strips(tmp_path / "none.png", FIGURE, [], 50)


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_short_dances_have_as_many_figures_as_poses(tmp_path: Path, frames: int) -> None:
    poses, roots = dance(FIGURE, frames)
    holds = held_throughout(poses, [3])
    assert draw_filmstrip(tmp_path / "short.png", FIGURE, poses, roots, 50, holds, columns=8).is_file()


def test_no_poses_are_no_picture(tmp_path: Path) -> None:
    poses, roots = dance(FIGURE)
    with pytest.raises(ValueError, match="at least one pose"):
        draw_filmstrip(tmp_path / "none.png", FIGURE, poses[:0], roots[:0], 50)


@pytest.mark.parametrize(
    "skeleton",
    [
        Skeleton(("lonely",), (-1,), np.zeros((1, 3))),
        Skeleton(("a", "b", "c"), (-1, 0, 1), np.array([[0, 0, 0], [0, 1.0, 0], [0, 1.0, 0]])),
        Skeleton(("body", "head"), (-1, 0), np.array([[0, 0, 0], [0, 20.0, 0]])),
    ],
    ids=["one joint", "a chain", "other units"],
)
def test_any_skeleton_has_a_body(tmp_path: Path, skeleton: Skeleton) -> None:
    poses, roots = dance(skeleton, 3)
    body = Body(skeleton).cones(*skeleton.forward_kinematics(poses[0], roots[0]))
    assert (body.start_radius > 0).all()
    assert draw_filmstrip(tmp_path / "any.png", skeleton, poses, roots, 50, columns=2, rows=1).is_file()


WITHOUT_MATPLOTLIB = """
import sys
sys.modules["matplotlib"] = None
import numpy as np
from appliance.pictures.filmstrip import MissingPicturesError, draw_filmstrip
from appliance.pose.skeleton import Skeleton
lonely = Skeleton(("hip",), (-1,), np.zeros((1, 3)))
try:
    draw_filmstrip("never.png", lonely, np.array([[[1.0, 0, 0, 0]]]), np.zeros((1, 3)), 50)
except MissingPicturesError as error:
    print(error)
"""


def test_without_matplotlib_the_message_says_what_to_install(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WITHOUT_MATPLOTLIB]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert "pip install 'bunraku[pictures]'" in done.stdout
    assert "The show itself runs without it" in done.stdout
    assert not (tmp_path / "never.png").exists()


def test_a_wide_pose_is_not_cut(tmp_path: Path) -> None:
    """Arms stretched along the row, at both ends of it: nothing of the figure touches the picture's edge."""
    skeleton = Skeleton(
        ("hip", "chest", "lShldr", "lHand", "rShldr", "rHand"),
        (-1, 0, 1, 2, 1, 4),
        np.array([[0, 0, 0], [0, 0.5, 0], [0.2, 0, 0], [1.4, 0, 0], [-0.2, 0, 0], [-1.4, 0, 0]], float),
    )
    poses = np.tile(quaternion.IDENTITY, (3, 6, 1)).astype(float)
    stage = Stage(skeleton, [Row(poses, np.zeros((3, 3)), np.arange(3))], 50.0)
    assert stage.figures[..., 3].any()
    assert not stage.figures[:, :4, 3].any() and not stage.figures[:, -4:, 3].any()


def test_times_count_from_where_the_recording_is_entered() -> None:
    poses = np.tile(quaternion.IDENTITY, (101, 2, 1)).astype(float)
    skeleton = Skeleton(("hip", "head"), (-1, 0), np.array([[0, 0, 0], [0, 1.5, 0]], float))
    rows = [Row(poses, np.zeros((101, 3)), np.array([0, 50, 100]))]
    for start_s, stamps in ((0.0, ["0.0 s", "1.0 s", "2.0 s"]), (5.0, ["5.0 s", "6.0 s", "7.0 s"])):
        assert [text for _, _, text in Stage(skeleton, rows, 50.0, start_s).times] == stamps


def test_a_title_in_any_script_is_drawn_without_a_warning(tmp_path: Path) -> None:
    poses, skeleton = (
        np.tile(quaternion.IDENTITY, (4, 2, 1)).astype(float),
        Skeleton(("hip", "head"), (-1, 0), np.array([[0, 0, 0], [0, 1.5, 0]], float)),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        draw_filmstrip(tmp_path / "a.png", skeleton, poses, np.zeros((4, 3)), 50.0, title="文楽 רקדן")
    assert (tmp_path / "a.png").exists()
