"""Two projectors on one wall: what both light adds up to one picture."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.alignment import Alignment
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass, part_of, picture_size
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.wall import DETAILS
from appliance.projector.resolution import SHARES
from appliance.projector.still import moment_of
from appliance.show.look import STYLES
from appliance.show.projector import EdgeBlendConfig, ProjectorConfig
from tests.projector.golden_looks import AT_S, difference
from tests.projector.stage_double import pixels

SIZE = 160, 80
GAMMA = 2.2
SIDES, ROWS = ("left", "right"), ("top", "bottom")
BOTH = pytest.mark.parametrize("parts", [SIDES, ROWS], ids=["side by side", "one above the other"])


class Display:
    """One projector's display, lit by a look or by a picture (height, width) of greys."""

    def __init__(self, gl: moderngl.Context, part: str, overlap: float, **config: object) -> None:
        blend = EdgeBlendConfig(part=part, overlap=overlap, gamma=GAMMA)  # type: ignore[arg-type]
        self.config = ProjectorConfig(edge_blend=blend, **config)  # type: ignore[arg-type]
        self.controls = Controls(Alignment.of_box(self.config), lambda _: None)
        self.overlap, self._gl, self.final = overlap, gl, FinalPass(gl, self.config)
        self.is_blended = True

    def look(self, looks: Renderer, dance: Recording, style: str, share: float = 1.0) -> np.ndarray:
        size = picture_size(self.config, SIZE, self.overlap, share)
        wall = self.final.wall(self._gl.screen, SIZE, self.controls, 1.0, size, detail=DETAILS[1])
        looks.draw(moment_of(dance, AT_S), style, style, 1.0, wall)
        if wall.framebuffer is not self._gl.screen:
            self.final.draw(self._gl.screen, SIZE, self.controls, 1.0, ())
        if self.is_blended:
            self.final.darken(self._gl.screen, SIZE, self.controls)
        return pixels(self._gl.screen, SIZE)

    def picture(self, greys: np.ndarray) -> np.ndarray:
        self.final.show_image(np.repeat(greys.astype(np.uint8)[..., None], 3, axis=2))
        self.final.draw(self._gl.screen, SIZE, self.controls, 1.0, ())
        self.final.darken(self._gl.screen, SIZE, self.controls)
        return pixels(self._gl.screen, SIZE)


def on_wall(one: np.ndarray, other: np.ndarray, overlap: float, parts: tuple[str, str]) -> np.ndarray:
    """Light of both projectors on the wall, as a projector of GAMMA gives it, 0 to 2."""
    axis = 1 if parts == SIDES else 0
    shared = round(overlap * SIZE[1 - axis])
    whole = list(one.shape)
    whole[axis] = 2 * one.shape[axis] - shared
    light = np.zeros(whole)
    there = [slice(None)] * one.ndim
    for picture, start in ((one, 0), (other, one.shape[axis] - shared)):
        there[axis] = slice(start, start + one.shape[axis])
        light[tuple(there)] += (picture / 255) ** GAMMA
    return light


@BOTH
@pytest.mark.parametrize("overlap", [0.1, 0.25, 0.5])
def test_a_grey_wall_is_even(gl: moderngl.Context, parts: tuple[str, str], overlap: float) -> None:
    """Null: without the ramps the overlap is twice as bright."""
    shown, unblended = [], []
    for part in parts:
        display = Display(gl, part, overlap)
        width, height = picture_size(display.config, SIZE, overlap)
        shown.append(display.picture(np.full((height, width), 220)))
        unblended.append(np.full_like(shown[0], 220))
    grey = (220 / 255) ** GAMMA
    assert on_wall(*shown, overlap, parts) == pytest.approx(grey, abs=0.02)
    assert on_wall(*unblended, overlap, parts).max() == pytest.approx(2 * grey)


@BOTH
def test_each_shows_its_part(gl: moderngl.Context, parts: tuple[str, str]) -> None:
    displays = [Display(gl, part, 0.25) for part in parts]
    width, height = picture_size(displays[0].config, SIZE, 0.25)
    assert (width, height) == ((280, 80) if parts == SIDES else (160, 140))
    ramp = np.linspace(0, 250, width if parts == SIDES else height)
    greys = np.broadcast_to(ramp if parts == SIDES else ramp[:, None], (height, width))
    wall = on_wall(*(display.picture(greys) for display in displays), 0.25, parts)
    assert 255 * wall[..., 0] ** (1 / GAMMA) == pytest.approx(greys, abs=4.0)
    assert part_of(None, 0.0) == (part := part_of(None, 0.3)) and part.width == part.height == 1.0


@BOTH
@pytest.mark.parametrize("share", [1.0, SHARES[1]])
def test_two_pictures_of_a_look_are_one(
    gl: moderngl.Context, dance: Recording, looks: Renderer, parts: tuple[str, str], share: float
) -> None:
    """Against the wide picture of one projector. Null: the same light without the ramps."""
    overlap = 0.25
    displays = [Display(gl, part, overlap, wall="screen") for part in parts]
    size = picture_size(displays[0].config, SIZE, overlap)
    wide = gl.framebuffer([gl.texture(size, 4)])
    alone = FinalPass(gl, ProjectorConfig(wall="screen"))
    controls = Controls(Alignment(), lambda _: None)
    for style in STYLES:
        drawn = picture_size(ProjectorConfig(), size, 0.0, share)
        wall = alone.wall(wide, size, controls, 1.0, drawn, detail=DETAILS[1])
        looks.draw(moment_of(dance, AT_S), style, style, 1.0, wall)
        if wall.framebuffer is not wide:
            alone.draw(wide, size, controls, 1.0, ())
        wanted = pixels(wide, size)
        light = on_wall(*(one.look(looks, dance, style, share) for one in displays), overlap, parts)
        found = np.clip(255 * light ** (1 / GAMMA), 0, 255).round().astype(np.uint8)
        mean, p99 = difference(found, wanted)
        assert mean < 1.5 and p99 < 20.0, (style, mean, p99)
        for display in displays:
            display.is_blended = False
        bare = on_wall(*(one.look(looks, dance, style, share) for one in displays), overlap, parts)
        middle = tuple(slice(round(0.46 * side), round(0.54 * side)) for side in bare.shape[:2])
        bright = bare[middle].mean() / ((wanted[middle] / 255) ** GAMMA).mean()
        assert bright > 1.8, style
        for display in displays:
            display.is_blended = True


def test_keystone_cuts_off_the_other_part(gl: moderngl.Context, dance: Recording, looks: Renderer) -> None:
    display = Display(gl, "left", 0.2)
    pinned = ((0.1, 0.1), (0.7, 0.2), (0.75, 0.9), (0.05, 0.8))
    display.controls.alignment = replace(display.controls.alignment, corners=pinned)
    lit = display.look(looks, dance, "ink").max(axis=2) > 0
    assert lit[20:62, 16:90].mean() > 0.95, "paper"
    assert not lit[:, 121:].any() and not lit[:7].any() and not lit[73:].any()


def test_the_grids_of_two_projectors_meet(gl: moderngl.Context) -> None:
    """Where both light the wall they show the same line, and neither is dimmed: one sees both."""
    columns = []
    for part in SIDES:
        display = Display(gl, part, 0.5)
        display.controls.set_grid(True)
        columns.append(display.picture(np.zeros((80, 240)))[..., 0])
    between = np.r_[20:34, 46:62]  # rows without numbers and names
    assert np.abs(columns[0][between, 80:].astype(int) - columns[1][between, :80]).max() <= 2
    assert columns[0][between, -40:].max() > 200


def test_overlap_and_gamma_follow_the_technician(gl: moderngl.Context) -> None:
    display, kept = Display(gl, "left", 0.2), []
    display.controls = Controls(Alignment.of_box(display.config), kept.append)
    white = np.full((80, 288), 255)
    before = display.picture(white)[40, :, 0].astype(int)
    assert before[127] == 255 and before[150] < 200
    done, sentence = display.controls.blend("overlap", 0.4)
    assert done and sentence == "The pictures overlap by 40.0 %, blended with a gamma of 2.2."
    assert display.picture(white)[40, 127, 0] < 240
    assert display.controls.blend("blend_gamma", 9.0)[1].endswith("a gamma of 3.")
    assert (kept[-1].overlap, kept[-1].blend_gamma) == (0.4, 3.0)
    done, sentence = Controls(Alignment(), kept.append).blend("overlap", 0.4)
    assert not done and "edge_blend" in sentence
