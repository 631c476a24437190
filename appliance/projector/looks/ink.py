"""Ink: a brushed silhouette on paper, its echoes of the last second, and the strokes of hands and feet."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from appliance.projector.drawing import Drawing
from appliance.projector.glow import Glow
from appliance.projector.looks.palette import palette
from appliance.projector.particles import LAYOUT, NAMES
from appliance.projector.poses import ROW_S, ROWS
from appliance.projector.scene import Easel, Scene
from appliance.projector.strands import reach_of
from appliance.projector.trails import traced
from appliance.show.look import LookConfig

ECHOES = 5
STROKES = 12
WET = 180  # lines of the picture in which ink spreads


class Ink:
    """Draws the figure of ink."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._figure = easel.surface("body", "ink")
        self._echo = easel.surface("body", "ink", coarse=True)
        reach = reach_of(easel.skeleton, easel.bind_positions)
        self._buffer = easel.ctx.buffer(traced(easel.body, reach, STROKES).packed())
        self._strokes = Drawing(easel.ctx, "trail", "stroke", [(self._buffer, LAYOUT + "/i", *NAMES)])
        self._glow = Glow(easel)
        self._finish = Drawing(easel.ctx, "air", "ink_finish")

    def draw(self, scene: Scene, look: LookConfig, opacity: float, target: moderngl.Framebuffer) -> None:
        """Lay the look over what is in the target."""
        easel, view, colours = self._easel, scene.view, palette(look)
        picture = easel.picture(target.size, look.render_scale)
        picture.start()
        common: dict[str, Any] = {
            "poses": easel.poses.texture,
            "noise": easel.noise,
            "projection": view.projection,
            "eye": view.eye,
        }
        picture.keep("r")
        easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._figure.draw(easel.tally, **common, row=0, level=1.0, hollow=1.0)
        easel.ctx.enable_only(moderngl.BLEND)
        easel.ctx.blend_equation = moderngl.MAX
        if look.trail_s > 0:
            rows = min(ROWS, max(6, round(look.trail_s / ROW_S)))
            picture.keep("g")
            for echo in range(1, ECHOES + 1):
                level = 0.85 * (1 - echo / (ECHOES + 1)) ** 1.2
                self._echo.draw(
                    easel.tally, **common, row=round((rows - 1) * echo / ECHOES), level=level, hollow=0.0
                )
            picture.keep("b")
            self._strokes.draw(
                easel.tally, moderngl.TRIANGLE_STRIP, 2 * rows, STROKES, **common,
                pixel=(2 / picture.size[0], 2 / picture.size[1]), width=0.013 * picture.size[1], rows=rows, row_s=ROW_S, floor_side=1.0, brightness=0.9,
            )  # fmt: skip
        easel.ctx.blend_equation = moderngl.FUNC_ADD
        picture.keep("rgba")
        wet = self._glow.spread(picture, "near glow", WET)
        x, y, _, w = view.projection @ [view.ground[0], 0.0, view.ground[1], 1.0]
        easel.finish(target)
        self._finish.draw(
            easel.tally,
            vertices=3,
            picture=picture.texture,
            near_glow=wet.texture,
            noise=easel.noise,
            figure_colour=np.sqrt(colours.figure),
            light_colour=np.sqrt(colours.light),
            accent_colour=np.sqrt(colours.accent),
            air_colour=np.sqrt(colours.background),
            foot=(scene.aspect * (0.5 + 0.5 * x / w), 0.5 + 0.5 * y / w),
            foot_size=0.28 / (view.slopes[1] * w),
            aspect=scene.aspect,
            fog=look.fog,
            shadow=look.shadow,
            density=look.density,
            vignette=look.vignette,
            exposure=look.exposure,
            opacity=opacity,
        )

    def release(self) -> None:
        for part in (self._figure, self._echo, self._strokes, self._buffer, self._glow, self._finish):
            part.release()
