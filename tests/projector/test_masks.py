"""Masks: parts of the display that stay dark, wherever the picture's corners lie."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
import pytest

from appliance.projector.alignment import Alignment
from appliance.projector.context import offscreen
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass
from appliance.projector.masks import GHOST
from appliance.show.projector import MaskConfig, ProjectorConfig
from tests.projector.stage_double import pixels

SIZE = (160, 90)
DOOR = [(0.25, 0.5), (0.5, 0.5), (0.5, 1.0), (0.25, 1.0)]


@pytest.fixture(scope="module")
def gl() -> Iterator[moderngl.Context]:
    with offscreen(SIZE) as context:
        yield context


def masked(
    gl: moderngl.Context, masks: list[dict[str, Any]], alignment: Alignment | None = None, **config: Any
) -> np.ndarray:
    """What masks leave of a white display, 0..255."""
    controls = Controls(alignment or Alignment(), lambda _: None)
    final = FinalPass(gl, ProjectorConfig(masks=[MaskConfig(**mask) for mask in masks], **config))
    for _ in range(2):  # the second time from what was kept
        gl.screen.clear(1.0, 1.0, 1.0, 1.0)
        final.darken(gl.screen, SIZE, controls)
    found = pixels(gl.screen, SIZE)[..., 0].astype(int)
    final.release()
    return found


def test_a_door_is_dark_to_its_edges_and_the_rest_as_bright_as_it_was(gl: moderngl.Context) -> None:
    left = masked(gl, [{"points": DOOR, "soft": 0.0}])
    expected = np.full((90, 160), 255)
    expected[45:, 40:80] = 0
    off = np.abs(left - expected)
    assert off.max() <= 128 and (off > 0).sum() <= 2 * (40 + 45)  # half a pixel around
    assert (masked(gl, []) == 255).all()


def test_outside_is_the_other_way_round_and_several_add_up(gl: moderngl.Context) -> None:
    door = {"points": DOOR, "soft": 0.0}
    outside = masked(gl, [door | {"dark": "outside"}])
    assert np.abs(outside - (255 - masked(gl, [door]))).max() <= 1
    assert np.array_equal(
        masked(gl, [door, door | {"dark": "outside"}]), np.minimum(outside, masked(gl, [door]))
    )


def test_a_soft_edge_is_a_ramp_as_wide_as_it_says(gl: moderngl.Context) -> None:
    left = masked(gl, [{"points": [(-1, -1), (0.5, -1), (0.5, 2), (-1, 2)], "soft": 0.1}])[45]
    assert left[:66].max() == 0 and left[94:].min() == 255 and abs(int(left[79:81].sum()) - 255) < 8
    assert (np.diff(left) >= 0).all()
    ramp = np.flatnonzero((left > 25) & (left < 230))
    assert 5 <= len(ramp) <= 14


def test_masks_hang_with_the_projector_and_do_not_move_with_the_corners(gl: moderngl.Context) -> None:
    door = [{"points": DOOR, "soft": 0.0}]
    plain = masked(gl, door)
    assert np.array_equal(masked(gl, door, Alignment(mirror=True)), plain[:, ::-1])
    assert np.array_equal(masked(gl, door, upside_down=True), plain[::-1, ::-1])
    pinned = Alignment(((0.1, 0.1), (0.9, 0.2), (0.8, 0.9), (0.0, 0.8)))
    assert np.array_equal(masked(gl, door, pinned), plain)


def test_under_the_grid_masks_let_through_what_they_hide(gl: moderngl.Context) -> None:
    controls = Controls(Alignment(), lambda _: None)
    controls.set_grid(True)
    final = FinalPass(gl, ProjectorConfig(masks=[MaskConfig(points=DOOR, soft=0.0)]))
    gl.screen.clear(1.0, 1.0, 1.0, 1.0)
    final.darken(gl.screen, SIZE, controls)
    assert abs(int(pixels(gl.screen, SIZE)[60, 60, 0]) - 255 * (1 - GHOST)) <= 1
    final.release()
