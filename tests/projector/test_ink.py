"""Ink as a brush: pressure, splashes at accents, and a paper that keeps strokes and dries."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from appliance.outputs.coupling import ROW_S, ROWS
from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.recording import Recording
from appliance.projector.picture.accents import Accent, accents, pressure
from appliance.projector.picture.camera import view
from appliance.projector.picture.kept_strokes import STAIN, STAIN_STEPS, STEP_S, WET, WET_LOSS, KeptStrokes
from appliance.projector.picture.looks.ink import Ink
from appliance.projector.picture.poses import Poses, poses_of
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.scene import Easel
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import CameraConfig, LookConfig
from tests.projector.golden_looks import SIZE, Picture
from tests.projector.skeletons import quadruped

INK = {"ink": LookConfig(name="ink", style="ink")}


def stopped(time_s: float, speed: float) -> Poses:
    """A joint that went to the right at `speed` figure heights a second and stopped at 10 s."""
    way = np.minimum(time_s - ROW_S * np.arange(ROWS) - 10.0, 0.0) * speed
    positions = np.zeros((ROWS, 2, 3), np.float32)
    positions[:, 1, 0] = way
    return Poses(positions, np.tile(np.float32([1, 0, 0, 0]), (ROWS, 2, 1)))


def test_a_sudden_stop_is_an_accent_in_the_way_of_the_move_and_stays_the_same() -> None:
    found: list[Accent] = []
    for late in np.arange(0.2, 0.8, 1 / 60):
        [one] = accents(stopped(10.0 + late, 4.0), [1], 10.0 + late)
        assert one.age_s == pytest.approx(late, abs=2 * ROW_S)
        found.append(one)
    assert len({one.seed for one in found}) == 1
    assert all(one.strength == 1.0 and one.way[0] == pytest.approx(4.0, rel=0.05) for one in found)
    assert np.ptp([one.place[0] for one in found]) < 0.05


def test_a_soft_stop_and_an_even_move_are_none() -> None:
    assert accents(stopped(10.5, 1.0), [1], 10.5) == []
    assert accents(stopped(9.0, 4.0), [1], 9.0) == []


def test_a_brush_is_pressed_where_a_limb_is_slow() -> None:
    assert pressure(stopped(9.0, 4.0)).tolist() == [1.0, 0.0]
    assert pressure(stopped(11.0, 4.0)).tolist() == [1.0, 1.0]


def test_splashes_and_pressure_are_in_the_picture(
    dance: Recording, gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each changes pixels near its place alone; a frozen dance has neither."""
    renderer = Renderer(gl, dance.skeleton, INK)
    moment = moment_of(dance, 17.6)
    ends = [Anatomy(dance.skeleton).chain(first)[-1] for _, first in Anatomy(dance.skeleton).limbs()]
    assert len(ends) == 4
    whole = draw_still(gl, renderer, moment, "ink", SIZE).astype(int)
    with monkeypatch.context() as without:
        without.setattr("appliance.projector.picture.looks.ink.accents", lambda *_: [])
        dull = draw_still(gl, renderer, moment, "ink", SIZE).astype(int)
    changed = np.abs(whole - dull).max(axis=2) > 40
    assert 0.0005 < changed.mean() < 0.02
    ways = whole[changed] - dull[changed]
    assert (ways[:, 0] > ways[:, 2] - 60).all()  # towards the accent's red, never towards blue
    with monkeypatch.context() as without:
        without.setattr(
            "appliance.projector.picture.looks.ink.pressure",
            lambda poses: np.zeros(poses.positions.shape[1], np.float32),
        )
        lifted = draw_still(gl, renderer, moment, "ink", SIZE).astype(int)
    assert lifted[..., 1].mean() > whole[..., 1].mean() + 0.2  # a lifted brush leaves more paper
    renderer.release()


def danced(gl: moderngl.Context, dance: Recording, rate: float, seconds: float = 4.0) -> Picture:
    """The last picture of a stretch of the dance."""
    renderer = Renderer(gl, dance.skeleton, INK, keeps_strokes=True)
    for tick in range(round(seconds * rate) + 1):
        picture = draw_still(gl, renderer, moment_of(dance, 14.0 + tick / rate), "ink", SIZE)
    renderer.release()
    return picture


def test_the_paper_keeps_strokes_alike_at_any_rate_of_pictures(
    dance: Recording, gl: moderngl.Context
) -> None:
    blank = Renderer(gl, dance.skeleton, INK)
    without = draw_still(gl, blank, moment_of(dance, 18.0), "ink", SIZE).astype(int)
    blank.release()
    often, rarely = (danced(gl, dance, rate).astype(int) for rate in (50.0, 25.0))
    assert np.array_equal(rarely, danced(gl, dance, 25.0))
    kept = np.abs(often - without).max(axis=2) > 8
    assert kept.mean() > 0.02
    assert np.abs(often - rarely)[kept].mean() < 0.3 * np.abs(often - without)[kept].mean()


def test_strokes_dry_in_the_danced_time_and_a_time_that_goes_back_starts_a_blank_sheet(
    dance: Recording, gl: moderngl.Context
) -> None:
    easel = Easel(gl, dance.skeleton)
    sheet = KeptStrokes(easel)
    full = easel.drawing("screen", "dry")

    def lay(_target: object, strength: float) -> None:
        full.draw({"loss": (strength,) * 4})

    def nothing(_target: object, _strength: float) -> None:
        full.draw({"loss": (0.0,) * 4})

    def shades(time_s: float, how: object) -> tuple[int, ...]:
        pixels = sheet.at(time_s, 1.0, how).buffer.read(components=4)  # type: ignore[arg-type]
        return tuple(np.frombuffer(pixels, np.uint8).reshape(-1, 4)[0, :2].tolist())

    wet, stain = round(255 * WET), round(255 * STAIN)
    assert shades(100.1, lay) == (0, 0)
    for again in range(1, 50):  # strokes over each other make no darker one
        assert shades(100.1 + again * STEP_S, lay) == (wet, stain)
    now = 100.1 + 49 * STEP_S
    damp = shades(now + 10 * STEP_S, nothing)
    assert damp[0] == wet - 10 * WET_LOSS and stain - 1 <= damp[1] <= stain
    later = shades(now + 5 * STAIN_STEPS * STEP_S, nothing)
    assert later[0] == 0 and stain - 6 <= later[1] < stain
    assert shades(now + 3600.0, nothing) == (0, 0)
    assert shades(now + 3601.0, lay) == (wet, stain)
    assert shades(5.0, lay) == (0, 0)
    assert shades(9.0, None) == (0, 0)
    easel.release()


def test_without_a_trail_nothing_is_kept(dance: Recording, gl: moderngl.Context) -> None:
    look = {"ink": LookConfig(name="ink", style="ink", trail_s=0.0)}
    pictures = []
    for keeps in (False, True):
        renderer = Renderer(gl, dance.skeleton, look, keeps_strokes=keeps)
        for time_s in (16.0, 17.0, 17.6):
            picture = draw_still(gl, renderer, moment_of(dance, time_s), "ink", SIZE)
        pictures.append(picture)
        renderer.release()
    assert np.array_equal(*pictures)


CHALK = {"figure": "#f0e9da", "light": "#5b5550", "background": "#000000"}


@pytest.mark.parametrize(
    ("turned_deg", "colours", "darker"), [(0.0, {}, 25.0), (90.0, {}, 25.0), (0.0, CHALK, 10.0)]
)
def test_a_head_is_drawn_as_it_turns(
    turned_deg: float, colours: dict[str, str], darker: float, dance: Recording, gl: moderngl.Context
) -> None:
    """From behind the head is darker, however it is turned: dark ink draws the hair, light ink the face.

    It was a filled circle from all sides."""
    skeleton = dance.skeleton
    poses = np.tile(quaternion.IDENTITY, (1, len(skeleton), 1)).astype(float)
    poses[0, skeleton.index("head")] = quaternion.from_axis_angle((0.0, 1.0, 0.0), np.radians(turned_deg))
    moment = moment_of(Recording(skeleton, poses, np.zeros((1, 3)), 50.0), 0.0)
    easel = Easel(gl, skeleton)
    where = poses_of(moment, moment.puppets[0], easel.height, easel.sole)
    eyes = where.positions[0, [skeleton.index("leftEye"), skeleton.index("rightEye")]].mean(axis=0)
    easel.release()
    shades = []
    for angle_deg in (turned_deg, turned_deg - 180.0):
        camera = CameraConfig(move="still", angle_deg=angle_deg, elevation_deg=0.0)
        look = {
            "ink": LookConfig(
                name="ink", style="ink", trail_s=0.0, camera=camera, render_scale=1.0, **colours
            )
        }
        renderer = Renderer(gl, skeleton, look)
        picture = draw_still(gl, renderer, moment, "ink", (360, 360)).mean(axis=2)
        renderer.release()
        across, up = view(camera, camera, 1.0, 0.0, where, 1.0).on_picture(eyes.astype(float))
        x, y = round(360 * across), round(360 * (1.0 - up))
        shades.append(float(np.median(picture[y - 8 : y + 12, x - 6 : x + 7])))
    assert shades[0] > shades[1] + darker


def test_an_animal_has_no_face(gl: moderngl.Context) -> None:
    easel = Easel(gl, quadruped())
    assert Ink(easel)._head["head_drawn"] == 0.0
    easel.release()


def test_the_paper_ends_in_a_clean_edge(dance: Recording, gl: moderngl.Context) -> None:
    """It gets bright within a few pixels, and is not ruled straight."""
    renderer = Renderer(gl, dance.skeleton, {"ink": LookConfig(name="ink", style="ink", trail_s=0.0)})
    picture = draw_still(gl, renderer, moment_of(dance, 17.6), "ink", (1280, 720)).mean(axis=2)
    renderer.release()
    across = picture[:120, 160:1120:5]
    most = across.max(axis=0)
    begins = (across > 0.15 * most).argmax(axis=0)
    ends = (across > 0.6 * most).argmax(axis=0)
    assert (picture[:3] == 0.0).all()
    assert 2.0 < np.mean(ends - begins) < 12.0
    assert 0.8 < np.std(begins) < 6.0
