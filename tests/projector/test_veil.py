"""Veil: as bright where a body rests or points at the eye as elsewhere, and echoes where it has been."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import LookConfig
from tests.projector.golden_looks import AT_S, renderer
from tests.projector.skeletons import toy

SIZE = 480, 480
LIT = 4.0  # brighter than the dark room; white is 255
Picture = NDArray[np.float64]


def glass(trail_s: float = 0.0, elevation_deg: float = 0.0) -> LookConfig:
    """The figure in a dark room, at full resolution, before a camera that stands still."""
    camera = {"move": "still", "elevation_deg": elevation_deg, "figure": 0.8, "lens_deg": 22.0}
    room = {"fog": 0.0, "glow": 0.0, "shadow": 0.0, "vignette": 0.0, "render_scale": 1.0}
    return LookConfig.model_validate(
        {"name": "x", "style": "veil", "trail_s": trail_s, "camera": camera} | room
    )


def seen(gl: moderngl.Context, dance: Recording, look: LookConfig, time_s: float = 0.0) -> Picture:
    """(height, width) of 255."""
    with renderer(gl, dance.skeleton, {"x": look}) as made:
        return np.asarray(draw_still(gl, made, moment_of(dance, time_s), "x", SIZE).mean(axis=2))


def at_rest(skeleton: Skeleton) -> Recording:
    poses = np.tile(quaternion.IDENTITY, (1, len(skeleton), 1)).astype(float)
    return Recording(skeleton, poses, np.zeros((1, 3)), 50.0)


def test_a_figure_at_rest_is_hardly_brighter_for_the_echoes_in_its_place(
    dance: Recording, gl: moderngl.Context
) -> None:
    """The sum of them was 1.9 times as bright, an eighth of it white."""
    still = at_rest(dance.skeleton)
    one, with_echoes = seen(gl, still, glass()), seen(gl, still, glass(trail_s=1.0))
    on = one > LIT
    assert 1.0 < with_echoes[on].mean() / one[on].mean() < 1.4
    assert (with_echoes[on] > 240.0).mean() < 0.06


def test_echoes_are_seen_where_the_dancer_has_been(dance: Recording, gl: moderngl.Context) -> None:
    one, with_echoes = (seen(gl, dance, glass(trail_s), AT_S) for trail_s in (0.0, 1.0))
    beside = (one < LIT) & (with_echoes > 3 * LIT)
    assert beside.sum() > 0.3 * (one > LIT).sum()


def test_a_limb_that_points_at_the_eye_is_not_a_white_patch(gl: moderngl.Context) -> None:
    """A straight chain from 70 degrees above was 3 times as bright as from the side. Outlines still shine."""
    chain = at_rest(toy())
    aside, above = (seen(gl, chain, glass(elevation_deg=degrees)) for degrees in (0.0, 70.0))
    assert above[above > LIT].mean() < 2.3 * aside[aside > LIT].mean()
    row = aside[SIZE[1] // 2]
    on = np.flatnonzero(row > LIT)
    assert row[on].max() > 3 * row[on[len(on) // 2]]
