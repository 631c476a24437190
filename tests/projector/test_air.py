"""Air, floor and shutter: black where a projector shows grey, a shadow under the foot, no stroboscope."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.alignment import Alignment
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass
from appliance.projector.moment import Moment, PuppetMoment
from appliance.projector.picture.camera import view
from appliance.projector.picture.poses import poses_of
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.scene import MELT_ROUND_S, TIME_ROUND_S, Easel, Scene, direction
from appliance.projector.picture.shadow import Shadow
from appliance.projector.picture.wall import DETAILS, FLAT, Wall
from appliance.projector.still import moment_of
from appliance.show.look import STYLES, CameraConfig, LookConfig, Style
from appliance.show.projector import ProjectorConfig
from tests.projector.golden_looks import AT_S, renderer
from tests.projector.stage_double import pixels

SIZE = 640, 360
FAST_S = 18.88  # a foot moves at 7 m/s
SAMPLED = DETAILS[2]


def picture(gl: moderngl.Context, looks: Renderer, moment: Moment, style: str, **wall: object) -> np.ndarray:
    target = gl.framebuffer([gl.texture(SIZE, 4)])
    target.clear()
    looks.draw(moment, style, style, 1.0, replace(Wall(target, SIZE, SIZE, FLAT), **wall))
    found = pixels(target, SIZE).astype(int)
    target.release()
    return found


@pytest.mark.parametrize("style", ["plaster", "lines", "cloud", "veil"])
def test_air_that_is_nearly_black_is_black_on_a_projectors_wall(
    style: str, gl: moderngl.Context, looks: Renderer, dance: Recording
) -> None:
    final = FinalPass(gl, ProjectorConfig())
    toe = final.wall(gl.screen, SIZE, Controls(Alignment(), lambda _: None), 1.0, SIZE).toe
    final.release()
    moment = moment_of(dance, AT_S)
    screen, projector = (picture(gl, looks, moment, style, toe=one).max(axis=2) for one in (0.0, toe))

    def grey(levels: np.ndarray) -> float:
        return float(((levels > 1) & (levels < 24)).mean())

    assert grey(projector) < 0.75 * grey(screen), "as grey as before"
    bright = screen > 90
    assert np.abs(projector - screen)[bright].mean() < 3, "the figure changed, too"


def standing_at(moment: Moment, above_m: float) -> Moment:
    """The dance, higher."""
    up = np.float32([0.0, above_m, 0.0])
    puppet = moment.puppets[0]
    lifted = PuppetMoment(puppet.positions + up, puppet.world, [(p + up, w) for p, w in puppet.trail])
    return replace(moment, puppets=(lifted,))


def test_a_foot_on_the_floor_darkens_it_and_a_jump_does_not(gl: moderngl.Context, dance: Recording) -> None:
    easel = Easel(gl, dance.skeleton)
    shadow, camera = Shadow(easel), LookConfig(name="plain").camera
    moment, darkest = moment_of(dance, AT_S), []
    for above_m in (0.0, 0.2):
        lifted = standing_at(moment, above_m)
        poses = poses_of(lifted, lifted.puppets[0], easel.height, easel.sole)
        easel.show([poses], [None])
        scene = Scene(0.0, view(camera, camera, 1.0, 0.0, poses, 16 / 9), poses, 16 / 9)
        below = shadow.draw(scene, direction(-1.2, 50.0))["contact"]
        darkest.append(pixels(gl.framebuffer([below]), below.size)[..., 0].max())
    easel.release()
    assert darkest[0] > 150 and darkest[1] < 90


@pytest.mark.parametrize("style", ["plaster", "veil"])
def test_what_moves_fast_is_blurred_and_what_stands_is_not(
    style: str, gl: moderngl.Context, looks: Renderer, dance: Recording
) -> None:
    """The same moment with and without its movement, drawn with samples (which a shutter goes with)."""
    moment = moment_of(dance, FAST_S)
    puppet = moment.puppets[0]
    frozen = PuppetMoment(puppet.positions, puppet.world, [(puppet.positions, puppet.world)])
    still = Moment(moment.time_s, [moment.time_s], (frozen,))

    moving, held_still = (picture(gl, looks, of, style, detail=SAMPLED) for of in (moment, still))
    again = picture(gl, looks, still, style, detail=SAMPLED)
    assert (held_still == again).all()
    if style == "plaster":
        changed = np.abs(moving - held_still).max(axis=2)
        assert (changed[240:344] > 12).sum() > 40, "the foot is as sharp as if it stood"


def test_a_fast_limb_of_ink_runs_dry_and_the_rest_stays_as_it_is(
    gl: moderngl.Context, looks: Renderer, dance: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The null product: the same picture with a shutter that is open for no time."""
    moment = moment_of(dance, FAST_S)
    smeared = picture(gl, looks, moment, "ink", detail=SAMPLED)
    monkeypatch.setattr(Scene, "shutter", lambda scene, wall: [0.0])
    sharp = picture(gl, looks, moment, "ink", detail=SAMPLED)
    changed = np.abs(smeared - sharp).max(axis=2)
    assert (changed > 25).sum() > 40
    dark = sharp.max(axis=2) < 90
    assert changed[dark].mean() < 6, "a trunk that hardly moves"


@pytest.mark.parametrize("melt", [0.0, 1.0])
@pytest.mark.parametrize("style", STYLES)
def test_nothing_jumps_after_an_hour_when_the_shaders_time_begins_anew(
    style: Style, melt: float, gl: moderngl.Context, dance: Recording
) -> None:
    """It wrapped at 4096 s once: haze, dust and a molten surface were elsewhere in the next picture."""
    look = LookConfig(name="x", style=style, melt=melt, fog=1.0, camera=CameraConfig(move="still"))
    now = moment_of(dance, AT_S)

    def at(made: Renderer, time_s: float) -> np.ndarray:
        trail_times = [time + time_s - now.time_s for time in now.trail_times]
        return picture(gl, made, replace(now, time_s=time_s, trail_times=trail_times), "x")

    with renderer(gl, dance.skeleton, {"x": look}) as made:
        for anew_s in (4096.0, TIME_ROUND_S, 51 * MELT_ROUND_S):
            earlier, before, after = (at(made, anew_s + step) for step in (-0.03, -0.01, 0.01))
            assert np.abs(after - before).mean() < 2.0 * np.abs(before - earlier).mean() + 0.2
