"""A look that lays itself onto the wall shows what a picture shows that goes through the last step."""

from __future__ import annotations

from functools import partial

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.alignment import Alignment
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass, picture_size
from appliance.projector.picture.renderer import Renderer
from appliance.projector.resolution import SHARES
from appliance.projector.still import moment_of
from appliance.show.look import STYLES
from appliance.show.projector import EdgeBlendConfig, ProjectorConfig
from tests.projector.golden_looks import AT_S, P99_LIMIT, SIZE, difference, renderer
from tests.projector.gpu_cost import GpuCost, passes
from tests.projector.stage_double import pixels

FULL_HD = 1920, 1080
PINNED = ((0.05, 0.02), (0.93, 0.08), (0.98, 0.97), (0.0, 0.9))
ALIGNMENTS = {
    "whole": Alignment(),
    "pinned": Alignment(PINNED),
    "mirrored, dim": Alignment(mirror=True, brightness=0.6),
    "all": Alignment(PINNED, True, 1.4),
}
MOST_GPU_BYTES = 25e6
MOST_PASSES = 3.0  # the looks take 0.9 to 1.5 known passes of Mesa's llvmpipe


@pytest.mark.parametrize("name", ALIGNMENTS)
@pytest.mark.parametrize("upside_down", [False, True])
def test_laid_by_the_look_and_by_the_last_step_alike(
    name: str, upside_down: bool, gl: moderngl.Context, dance: Recording, looks: Renderer
) -> None:
    config = ProjectorConfig(upside_down=upside_down, gamma=1.3, wall="screen")
    final, whole = (FinalPass(gl, config) for _ in range(2))
    whole.resize(SIZE)
    controls = Controls(ALIGNMENTS[name], lambda _: None)
    moment = moment_of(dance, AT_S)
    for style in STYLES:
        wall = final.wall(gl.screen, SIZE, controls, 0.8, SIZE)
        assert wall.framebuffer is gl.screen
        looks.draw(moment, style, style, 1.0, wall)
        by_look = pixels(gl.screen, SIZE)
        looks.draw(moment, style, style, 1.0, whole.picture)
        whole.draw(gl.screen, SIZE, controls, 0.8, ())
        by_last_step = pixels(gl.screen, SIZE)
        assert by_look.max() > 60
        mean, p99 = difference(by_look, by_last_step)
        assert mean < 1.5 and p99 < P99_LIMIT, style
        assert not by_look[by_last_step.max(axis=2) == 0].max(initial=0) > 8, style
    final.release()
    whole.release()


def test_what_needs_more_than_laying_goes_through_the_last_step(gl: moderngl.Context) -> None:
    controls = Controls(Alignment(brightness=0.5), lambda _: None)
    final = FinalPass(gl, ProjectorConfig(gamma=1.2))
    direct = final.wall(gl.screen, SIZE, controls, 0.5, SIZE)
    assert (direct.framebuffer, direct.level, direct.gamma) == (gl.screen, 0.25, 1.2)
    assert final.picture.size == (1, 1)
    smaller = final.wall(gl.screen, SIZE, controls, 0.5, (160, 90))
    assert (smaller.framebuffer, smaller.level, smaller.gamma) == (final.picture, 0.25, 1.2)
    figures = final.wall(gl.screen, SIZE, controls, 0.5, SIZE, ("60 pictures/s",))
    assert (figures.framebuffer, figures.level, figures.gamma) == (final.picture, 1.0, 1.0)
    controls.set_grid(True)
    assert final.wall(gl.screen, SIZE, controls, 0.5, SIZE).framebuffer is final.picture
    final.release()


@pytest.mark.parametrize("share", SHARES[1:])
def test_a_smaller_picture_is_softer_and_otherwise_the_same(
    share: float, gl: moderngl.Context, dance: Recording
) -> None:
    display = 640, 360
    final = FinalPass(gl, ProjectorConfig(gamma=1.2))
    controls = Controls(Alignment(PINNED, brightness=0.9), lambda _: None)
    moment = moment_of(dance, AT_S)
    screen = gl.framebuffer([gl.texture(display, 4)])
    with renderer(gl, dance.skeleton) as looks:
        for style in STYLES:
            shown = []
            for part in (1.0, share):
                size = picture_size(ProjectorConfig(), display, 0.0, part)
                wall = final.wall(screen, display, controls, 0.8, size)
                looks.draw(moment, style, style, 1.0, wall)
                if wall.framebuffer is not screen:
                    final.draw(screen, display, controls, 0.8, ())
                shown.append(pixels(screen, display))
            assert difference(*shown)[0] < 3.0, style
            assert abs(shown[0].mean() - shown[1].mean()) < 0.05 * shown[0].mean(), style
    final.release()


@pytest.mark.parametrize(
    "blend", [None, EdgeBlendConfig(part="left", overlap=0.15)], ids=["one projector", "half a wall"]
)
def test_cost_with_the_last_step_at_1080p(
    gl: moderngl.Context, dance: Recording, blend: EdgeBlendConfig | None
) -> None:
    """GPU memory at each share of the display's size, and time at the largest. Half a wall costs no more than
    a picture that is corner-pinned, though twice as much is drawn.
    """
    config = ProjectorConfig(edge_blend=blend)
    alignment = Alignment.of_box(config) if blend else Alignment(PINNED)
    controls, cost = Controls(alignment, lambda _: None), GpuCost()
    with cost.watching(), renderer(gl, dance.skeleton) as looks:
        final = FinalPass(gl, config)

        def draw(style: str, share: float) -> None:
            size = picture_size(config, FULL_HD, alignment.overlap, share)
            wall = final.wall(gl.screen, FULL_HD, controls, 1.0, size)
            looks.draw(moment_of(dance, AT_S), style, style, 1.0, wall)
            if wall.framebuffer is not gl.screen:
                final.draw(gl.screen, FULL_HD, controls, 1.0, ())
            if blend:
                final.darken(gl.screen, FULL_HD, controls)

        for style in STYLES:
            for share in SHARES:
                draw(style, share)
                assert cost.memory_bytes < MOST_GPU_BYTES, style
            cost_now = passes(gl, FULL_HD, partial(draw, style, SHARES[0]), MOST_PASSES)
            assert cost_now < MOST_PASSES, style
        final.release()


def test_black_stays_black_when_it_is_dimmed(gl: moderngl.Context, dance: Recording, looks: Renderer) -> None:
    final = FinalPass(gl, ProjectorConfig())
    for level in (0.1, 0.5, 1.0):
        wall = final.wall(gl.screen, SIZE, Controls(Alignment(), lambda _: None), level, SIZE)
        looks.draw(moment_of(dance, AT_S), "lines", "lines", 1.0, wall)
        shown = pixels(gl.screen, SIZE)
        rim = np.concatenate([shown[0], shown[-1], shown[:, 0], shown[:, -1]])
        assert not rim.any() and shown.any()
    final.release()
