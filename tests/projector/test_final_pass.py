"""The picture onto the wall, pixel by pixel: corner-pin, mirror, levels, edge blend, grid and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import moderngl
import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from appliance.projector.alignment import Alignment
from appliance.projector.context import offscreen
from appliance.projector.controls import Controls
from appliance.projector.corners import Corners
from appliance.projector.final_pass import FinalPass
from appliance.projector.info import letters
from appliance.projector.warp import FINE, on_display
from appliance.show.projector import EdgeBlendConfig, ProjectorConfig
from tests.projector.stage_double import pixels

SIZE = (160, 90)
Show = Callable[..., np.ndarray]


@pytest.fixture(scope="module")
def gl() -> Iterator[moderngl.Context]:
    with offscreen(SIZE) as context:
        yield context


@pytest.fixture
def show(gl: moderngl.Context) -> Show:
    """Show a picture (h, w, 3) of bytes, top row first, and read the display."""

    def shown(
        picture: np.ndarray,
        /,
        alignment: Alignment | None = None,
        level: float = 1.0,
        controls: Controls | None = None,
        lines: tuple[str, ...] = (),
        **config: Any,
    ) -> np.ndarray:
        final = FinalPass(gl, ProjectorConfig(**config))
        height, width = picture.shape[:2]
        final.resize((width, height))
        opaque = np.dstack([picture, np.full((height, width), 255, np.uint8)])
        final.picture.color_attachments[0].write(np.ascontiguousarray(opaque[::-1]).tobytes())
        controls = controls or Controls(alignment or Alignment(), lambda _: None)
        final.draw(gl.screen, SIZE, controls, level, lines)
        found = pixels(gl.screen, SIZE)
        final.release()
        return found

    return shown


def noise(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)


def flat(value: int, width: int = SIZE[0]) -> np.ndarray:
    return np.full((SIZE[1], width, 3), value, np.uint8)


def test_without_corner_pin_each_byte_passes_unchanged(show: Show) -> None:
    assert np.array_equal(show(noise()), noise())


def test_mirror_and_upside_down(show: Show) -> None:
    mirrored = Alignment(mirror=True)
    assert np.array_equal(show(noise(), mirrored), noise()[:, ::-1])
    assert np.array_equal(show(noise(), upside_down=True), noise()[::-1, ::-1])
    assert np.array_equal(show(noise(), mirrored, upside_down=True), noise()[::-1])


@pytest.mark.parametrize(
    "corners", [((20, 10), (150, 4), (140, 80), (8, 70)), ((40, 30), (120, 20), (130, 60), (30, 85))]
)
def test_the_pictures_corners_land_on_the_wanted_pixels(show: Show, corners: Corners) -> None:
    pinned: Any = tuple((x / SIZE[0], y / SIZE[1]) for x, y in corners)
    lit = show(flat(255), Alignment(pinned))[..., 0] > 127
    depth = depth_inside(corners)
    clear = np.abs(depth) > 0.01  # pixels whose centre is clear of the edge
    assert clear.sum() > 0.99 * clear.size
    assert np.array_equal(lit[clear], depth[clear] > 0)


def depth_inside(corners: Corners) -> np.ndarray:
    """Distance of each pixel's centre inside the quadrilateral of four points, pixels: the oracle."""
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    depth = np.full(x.shape, np.inf)
    for k in range(4):
        (ax, ay), (bx, by) = corners[k], corners[(k + 1) % 4]
        across = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        depth = np.minimum(depth, across / np.hypot(bx - ax, by - ay))
    return depth


def test_straight_lines_stay_straight_on_the_wall(show: Show) -> None:
    picture = flat(0)
    picture[:, 100:103] = 255
    pinned = Alignment(((0.1, 0.1), (0.95, 0.02), (0.9, 0.95), (0.05, 0.8)))
    light = show(picture, pinned)[..., 0].astype(float)
    rows = np.flatnonzero(light.sum(axis=1) > 200)
    middles = (light[rows] @ np.arange(SIZE[0])) / light[rows].sum(axis=1)
    slope, start = np.polyfit(rows, middles, 1)
    assert len(rows) > 50 and abs(slope) > 0.005
    assert np.abs(middles - (start + slope * rows)).max() < 0.35


def test_level_and_brightness_multiply(show: Show) -> None:
    found = show(flat(200), Alignment(brightness=0.5), level=0.5).astype(float)
    assert abs(found.mean() - 50) < 0.6 and np.ptp(found) <= 1
    assert (show(flat(200), Alignment(brightness=2.0)) == 255).all()


def test_dark_steps_are_broken_up_and_black_stays_black(show: Show) -> None:
    dim = show(flat(200), level=0.1525)
    assert set(np.unique(dim)) == {30, 31}
    assert not show(flat(0), level=0.3).any()
    assert not show(noise(), level=0.0).any()


def test_gamma_lifts_the_dark_tones_and_keeps_black_and_white(show: Show) -> None:
    assert abs(show(flat(64), gamma=2.0).mean() - 255 * (64 / 255) ** 0.5) < 0.6
    assert (show(flat(255), gamma=2.0) == 255).all() and not show(flat(0), gamma=2.0).any()


def test_grid_corner_mark_and_figures_only_on_demand(show: Show) -> None:
    assert not show(flat(0)).any()
    controls = Controls(Alignment(), lambda _: None)
    controls.set_grid(True)
    grid = show(flat(0), controls=controls)
    assert 0.05 < (grid[..., 0] > 100).mean() < 0.6
    controls.set_grid(False)
    controls.choose(2)
    marked = show(flat(0), controls=controls)
    assert (marked != grid).any(axis=-1)[-40:, -40:].any()
    assert not (marked != grid).any(axis=-1)[:40, :40].any()
    figures = show(flat(0), lines=("60.0 pictures/s",))
    assert figures[:12].any() and not figures[12:].any()


def test_the_grid_is_clear_on_white_paper(show: Show) -> None:
    controls = Controls(Alignment(), lambda _: None)
    controls.set_grid(True)
    light = show(flat(255), controls=controls)[..., 0].astype(int)
    assert np.percentile(light, 95) - np.percentile(light, 30) > 120


@pytest.mark.parametrize(("picture", "width"), [(None, 70), ((120, 90), 93)])
def test_the_grid_has_a_circle_as_round_as_the_picture_is_drawn(
    show: Show, picture: tuple[int, int] | None, width: int
) -> None:
    """In a picture of 4:3 that fills 16:9 it is as wrong as the dancer."""
    controls = Controls(Alignment(), lambda _: None)
    controls.set_grid(True)
    light = show(flat(0), controls=controls, picture=picture)[..., 0] > 100
    turns = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    lit = light[
        (SIZE[1] / 2 + 35 * np.sin(turns)).astype(int), (SIZE[0] / 2 + width / 2 * np.cos(turns)).astype(int)
    ]
    assert lit.mean() > 0.9


def test_the_grid_numbers_the_corners_and_names_the_projector(show: Show) -> None:
    corners = ((0.1, 0.1), (0.9, 0.1), (0.95, 0.95), (0.05, 0.9))
    controls = Controls(Alignment(corners, overlap=0.5), lambda _: None)
    controls.set_grid(True)
    grids = [
        show(flat(0, 240), controls=controls, edge_blend=EdgeBlendConfig(part=part, overlap=0.5))
        for part in ("left", "right")
    ]
    for grid, name in zip(grids, ("LEFT PART", "RIGHT PART"), strict=True):
        white = (grid == 255).all(axis=-1)
        for number, (x, y) in zip("1234", ((26, 19), (134, 19), (142, 76), (18, 71)), strict=True):
            assert is_written(number, white, x, y)
        assert is_written(name, white, 80, 45)
    controls.set_grid(False)
    assert not show(flat(0), controls=controls).any()


def is_written(message: str, white: np.ndarray, x: int, y: int) -> bool:
    """Whether it stands there, give or take two pixels."""
    wanted = letters((message,)) > 0
    spots = sliding_window_view(white, wanted.shape)
    top, left = y - wanted.shape[0] // 2, x - wanted.shape[1] // 2
    near = spots[max(0, top - 2) : top + 3, max(0, left - 2) : left + 3]
    return bool((near == wanted).all(axis=(2, 3)).any())


WARP = tuple(
    (0.03 * (k % 3 - 1), 0.02 * (k % 4 - 1.5)) if k not in (0, 4, 20, 24) else (0.0, 0.0) for k in range(25)
)


@pytest.mark.parametrize("corners", [None, ((10, 4), (150, 2), (156, 86), (6, 80))])
def test_a_mesh_pulls_the_picture(show: Show, corners: Any) -> None:
    """A picture whose colours are its places shows where each of them is. Null: without the mesh."""
    across, down = np.meshgrid(np.linspace(0, 255, SIZE[0]), np.linspace(0, 255, SIZE[1]))
    places = np.dstack([across, down, np.zeros_like(down)]).round().astype(np.uint8)
    pinned = Alignment(warp=WARP)
    if corners is not None:
        a, b, c, d = ((x / SIZE[0], y / SIZE[1]) for x, y in corners)
        pinned = Alignment((a, b, c, d), warp=WARP)
    wanted = on_display(WARP, pinned.corners)
    share = np.linspace(0, 1, FINE)

    def errors(alignment: Alignment) -> np.ndarray:
        found = show(places, alignment).astype(float) / 255
        off = []
        for row, column in ((6, 9), (16, 16), (20, 25), (27, 12)):
            x, y = wanted[row, column] * SIZE
            seen = found[int(y), int(x), :2]
            off.append(np.abs(seen - (share[column], share[row])).max())
        return np.array(off)

    assert errors(pinned).max() < 0.015
    assert errors(Alignment(pinned.corners)).max() > 0.02


def test_a_mesh_is_mirrored_with_the_picture_and_lies_under_the_grid(show: Show) -> None:
    warped, mirrored = Alignment(warp=WARP), Alignment(warp=WARP, mirror=True)
    assert np.abs(show(noise(), mirrored)[:, ::-1].astype(int) - show(noise(), warped)).max() <= 2
    controls = Controls(warped, lambda _: None)
    controls.set_grid(True)
    assert show(flat(0), controls=controls).max() > 200
