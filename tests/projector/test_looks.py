"""Looks: the same moment makes the same picture, for any skeleton of any size, whatever was drawn before."""

from __future__ import annotations

import itertools
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.projector.picture import scene
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of, shrink
from appliance.show.look import STYLES, LookConfig, looks_by_name
from tests.projector.golden_looks import AT_S, FOLDER, MEAN_LIMIT, P99_LIMIT, SIZE, difference, renderer
from tests.projector.gpu_cost import GpuCost
from tests.projector.skeletons import mixamo, point, rope, toy

MOST_GPU_BYTES = 25e6
MOST_DRAW_CALLS = 20
MOST_TRIANGLES = 70_000
MOST_STEP = 165  # of 255 from one pixel to the next across an outline


@pytest.fixture
def drawing(gl: moderngl.Context, looks: Renderer) -> tuple[moderngl.Context, Renderer]:
    return gl, looks


def still(skeleton: Skeleton, size: float = 1.0) -> Recording:
    """A second of the rest pose."""
    poses = np.tile(quaternion.IDENTITY.astype(float), (60, len(skeleton), 1))
    grown = Skeleton(
        skeleton.names,
        skeleton.parents,
        skeleton.offsets * size,
        tuple((joint, (x * size, y * size, z * size)) for joint, (x, y, z) in skeleton.ends),
    )
    lowest = grown.forward_kinematics(poses[0], np.zeros(3))[0][:, 1].min()
    return Recording(grown, poses, np.tile([0.0, -lowest, 0.0], (60, 1)), 50.0)


def test_hundreds_of_joints_look_like_tens(gl: moderngl.Context) -> None:
    """A rope whose last tenth is bent; a byte counts 256 joints."""
    pictures = []
    for joints in (30, 300):
        dance = still(rope(joints))
        dance.poses[:, joints * 9 // 10] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
        with renderer(gl, dance.skeleton) as made:
            pictures.append(draw_still(gl, made, moment_of(dance, 1.0), "lines", SIZE))
    assert difference(*pictures)[0] < MEAN_LIMIT


@pytest.mark.parametrize("style", STYLES)
def test_golden_picture(style: str, dance: Recording, drawing: tuple[moderngl.Context, Renderer]) -> None:
    golden = np.asarray(Image.open(FOLDER / f"{style}.png").convert("RGB"))
    mean, p99 = difference(draw_still(*drawing, moment_of(dance, AT_S), style, SIZE), golden)
    assert mean < MEAN_LIMIT and p99 < P99_LIMIT
    mean, p99 = difference(draw_still(*drawing, moment_of(dance, AT_S + 0.04), style, SIZE), golden)
    assert mean > MEAN_LIMIT and p99 > P99_LIMIT


def test_same_moment_same_picture_whatever_came_before(
    dance: Recording, drawing: tuple[moderngl.Context, Renderer]
) -> None:
    moment = moment_of(dance, 46.2)
    first = [draw_still(*drawing, moment, style, SIZE) for style in STYLES]
    for style, picture in reversed(list(zip(STYLES, first, strict=True))):
        draw_still(*drawing, moment_of(dance, 3.0), "ink", (180, 320))
        assert np.array_equal(draw_still(*drawing, moment, style, SIZE), picture)


def test_a_band_of_leds_is_not_too_wide_for_the_textures_behind_it(
    dance: Recording, drawing: tuple[moderngl.Context, Renderer]
) -> None:
    for style in STYLES:
        assert draw_still(*drawing, moment_of(dance, AT_S), style, (3840, 64)).max() > 100


@pytest.mark.parametrize("size", [(320, 180), (240, 180), (180, 320), (400, 100)])
def test_edge_is_true_black_and_the_figure_inside(
    size: tuple[int, int], dance: Recording, drawing: tuple[moderngl.Context, Renderer]
) -> None:
    for style in STYLES:
        picture = draw_still(*drawing, moment_of(dance, AT_S), style, size)
        rim = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
        assert not rim.any(), style
        assert picture.max() > 100, style


@pytest.mark.parametrize("style", ("plaster", "cloud", "veil", "strings"))
def test_no_frame_can_be_seen_on_a_wall(style: str, dance: Recording, gl: moderngl.Context) -> None:
    """Light falls off around the middle: there is next to none near an ellipse that touches all four edges.

    Where it only fades along the edges, the corners of the frame are as bright as its inside.
    """
    looks = {"x": LookConfig(name="x", style=style, fog=1.0, trail_s=0.0)}
    with renderer(gl, dance.skeleton, looks) as made:
        picture = draw_still(gl, made, moment_of(dance, AT_S), "x", SIZE).max(axis=2).astype(float)
    across, up = (2.0 * (np.arange(size) + 0.5) / size - 1.0 for size in SIZE)
    away = np.hypot(across[None], up[:, None])
    inside, outside = picture[(away > 0.45) & (away < 0.6)], picture[(away > 0.95) & (away < 1.05)]
    assert outside.mean() < 0.1 * inside.mean() and outside.max() < 24


def test_a_shrunk_still_has_no_bands() -> None:
    """Its means lie between two steps of light, and black stays black."""
    fine = np.full((64, 64, 3), 10, np.uint8)
    fine[::2, ::2] = 11
    assert abs(shrink(fine).mean() - 10.25) < 0.05
    assert not shrink(np.zeros_like(fine)).any()


def test_cross_fade_mixes_the_two_pictures(
    dance: Recording, drawing: tuple[moderngl.Context, Renderer]
) -> None:
    gl, looks = drawing
    moment = moment_of(dance, AT_S)
    whole = {
        style: draw_still(gl, looks, moment, style, SIZE).astype(int) for style in ("ink", "lines", "plaster")
    }
    target = gl.framebuffer([gl.texture(SIZE, 4)])
    for before, now, mix in (("ink", "lines", 0.25), ("lines", "plaster", 0.6), ("plaster", "ink", 1.0)):
        looks.draw(moment, now, before, mix, target)
        pixels = np.frombuffer(target.read(components=4), np.uint8).reshape(SIZE[1], SIZE[0], 4)
        expected = (1 - mix) * whole[before] + mix * whole[now]
        assert np.abs(pixels[::-1, :, :3] - expected).max() <= 2


def test_a_cross_fade_makes_no_canvas_anew(
    dance: Recording, drawing: tuple[moderngl.Context, Renderer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two looks that wanted one canvas in two sizes would both make it again in each picture."""
    gl, looks = drawing
    canvas = gl.framebuffer([gl.texture(SIZE, 4)])
    moment = moment_of(dance, AT_S)
    for one, other in itertools.combinations(STYLES, 2):
        looks.draw(moment, one, other, 0.5, canvas)
        with monkeypatch.context() as patched:
            patched.setattr(scene, "Target", lambda *_, pair=(one, other): pytest.fail(f"{pair}"))
            looks.draw(moment, one, other, 0.6, canvas)
    canvas.release()


def test_outline_of_ink_is_smooth(dance: Recording, gl: moderngl.Context) -> None:
    """Along an outline there are tones between ink and paper; a hard edge has nearly none."""
    plain = {"ink": LookConfig(name="ink", style="ink", trail_s=0.0, figure="#000000", background="#ffffff")}
    size = 1280, 720
    with renderer(gl, dance.skeleton, plain) as made:
        picture = draw_still(gl, made, moment_of(dance, AT_S), "ink", size)[100:620, 500:900, 1].astype(int)
    step = np.abs(np.diff(picture, axis=1)).max(axis=1)
    assert picture.min() < 60 and picture.max() > 200
    assert np.median(step[step > 40]) < MOST_STEP


def test_unknown_look_is_the_first(dance: Recording, drawing: tuple[moderngl.Context, Renderer]) -> None:
    moment = moment_of(dance, AT_S)
    assert np.array_equal(
        draw_still(*drawing, moment, "no such look", SIZE), draw_still(*drawing, moment, "plaster", SIZE)
    )


def test_colours_of_the_show(dance: Recording, gl: moderngl.Context) -> None:
    red = dict.fromkeys(("figure", "light", "accent"), "#ff0000")
    looks = {
        "red": LookConfig(name="red", style="lines", fog=0.0, **red),
        "chalk": LookConfig(name="chalk", style="ink", figure="#ffffff", background="#000000"),
    }
    with renderer(gl, dance.skeleton, looks) as made:
        red_lines, chalk = (
            draw_still(gl, made, moment_of(dance, AT_S), name, SIZE).astype(int) for name in ("red", "chalk")
        )
    assert red_lines[..., 0].max() > 150 and red_lines[..., 1:].max() < 60
    assert chalk.max() > 200 and np.median(chalk) == 0


def test_an_image_lies_behind_the_figure_and_ends_in_black(
    dance: Recording, gl: moderngl.Context, tmp_path: Path
) -> None:
    """Blue on the left, red on the right; cut to the picture's shape, not squeezed."""
    wide = np.zeros((60, 240, 3), np.uint8)
    wide[:, :120, 2] = wide[:, 120:, 0] = 160
    Image.fromarray(wide).save(tmp_path / "hall.png")
    with_image = {
        name: look.model_copy(update={"image": str(tmp_path / "hall.png")})
        for name, look in looks_by_name(()).items()
    }
    plain = dict(looks_by_name(()))
    with renderer(gl, dance.skeleton, with_image) as made, renderer(gl, dance.skeleton, plain) as bare:
        for style in STYLES:
            seen, without = (
                draw_still(gl, one, moment_of(dance, AT_S), style, SIZE).astype(int) for one in (made, bare)
            )
            assert not seen[0].any() and not seen[:, 0].any(), style
            left, right = seen[60:120, 70:90].mean(axis=(0, 1)), seen[60:120, 230:250].mean(axis=(0, 1))
            assert left[2] > left[0] + 40 and right[0] > right[2] + 40, style
            assert np.abs(seen - without).mean() > 10, style


@pytest.mark.parametrize("skeleton", [mixamo(), toy()], ids=["mixamo", "toy"])
def test_any_skeleton_of_any_size_looks_alike(skeleton: Skeleton, gl: moderngl.Context) -> None:
    pictures = []
    for size in (1.0, 20.0):
        recording = still(skeleton, size)
        with renderer(gl, recording.skeleton) as made:
            pictures.append(draw_still(gl, made, moment_of(recording, 1.0), "plaster", SIZE))
    assert pictures[0].max() > 100
    mean, p99 = difference(*pictures)
    assert mean < MEAN_LIMIT and p99 < P99_LIMIT


@pytest.mark.parametrize("style", STYLES)
def test_a_single_joint_can_be_shown(style: str, gl: moderngl.Context) -> None:
    recording = still(point())
    with renderer(gl, recording.skeleton) as made:
        assert draw_still(gl, made, moment_of(recording, 0.5), style, SIZE).max() > 20


def test_first_picture_of_a_show_has_no_past(
    dance: Recording, drawing: tuple[moderngl.Context, Renderer]
) -> None:
    moment = moment_of(dance, 0.0)
    assert len(moment.trail_times) == 1
    for style in STYLES:
        assert draw_still(*drawing, moment, style, SIZE).max() > 100


def test_trail_of_no_length_leaves_no_trace(dance: Recording, gl: moderngl.Context) -> None:
    styles = ("lines", "ink", "cloud", "veil")
    looks = {
        f"{style} {trail_s}": LookConfig(name=style, style=style, trail_s=trail_s)
        for style in styles
        for trail_s in (0.0, 1.2)
    }
    with renderer(gl, dance.skeleton, looks) as made:
        for style in styles:
            without, with_ = (
                draw_still(gl, made, moment_of(dance, AT_S), f"{style} {trail_s}", SIZE)
                for trail_s in (0.0, 1.2)
            )
            assert difference(without, with_)[1] > P99_LIMIT
            assert contrast(without) < 30 < contrast(with_), style


def contrast(picture: np.ndarray) -> int:
    """Between the lightest and the darkest spot where a hand was half a second ago and nothing is now."""
    return int(np.ptp(picture[36:70, 112:142].max(axis=2).astype(int)))


def test_cost_at_1080p(dance: Recording, gl: moderngl.Context) -> None:
    """Draw calls and triangles of each look; GPU memory of all looks together, without the target."""
    size, cost = (1920, 1080), GpuCost()
    with cost.watching(), renderer(gl, dance.skeleton) as made:
        for style in STYLES:
            cost.draw_calls = 0
            with gl.query(primitives=True) as triangles:
                draw_still(gl, made, moment_of(dance, AT_S), style, size)
            assert 0 < cost.draw_calls <= MOST_DRAW_CALLS, style
            assert 0 < triangles.primitives < MOST_TRIANGLES, style
        assert 0 < cost.memory_bytes < MOST_GPU_BYTES
    assert cost.memory_bytes == 0
