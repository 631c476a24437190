"""Veil: a figure of glass, and behind it the figures that it has just been."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.projector.glow import Glow
from appliance.projector.looks.palette import palette
from appliance.projector.poses import ROW_S, ROWS
from appliance.projector.scene import Easel, Scene, direction
from appliance.show.look import LookConfig

ECHOES = 7


class Veil:
    """Draws the figure of glass."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._figure = easel.surface("body", "veil")
        self._echo = easel.surface("body", "veil", coarse=True)
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, target: moderngl.Framebuffer) -> None:
        """Lay the look over what is in the target."""
        easel, view, colours = self._easel, scene.view, palette(look)
        picture = easel.picture(target.size, look.render_scale)
        picture.start()
        easel.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        rows = min(ROWS - 1, round(look.trail_s / ROW_S))
        for echo in range(ECHOES if look.trail_s > 0 else 0, -1, -1):
            share = echo / (ECHOES + 1)
            colour = colours.figure * (1 - share) + colours.accent * share
            (self._figure if echo == 0 else self._echo).draw(
                easel.tally,
                poses=easel.poses.texture,
                projection=view.projection,
                eye=view.eye,
                lamp=direction(view.azimuth - 0.9, 40.0),
                row=round(rows * echo / ECHOES),
                figure_colour=np.sqrt(colour) * 0.5,
                light_colour=np.sqrt(colours.light) * 0.5,
                brightness=1.15 if echo == 0 else 0.5 * (1 - share) ** 1.5,
            )
        self._glow.finish(scene, look, colours, picture, opacity, target)

    def release(self) -> None:
        for part in (self._figure, self._echo, self._glow):
            part.release()
