"""Veil: a figure of glass, and behind it the figures that it has just been."""

from __future__ import annotations

import moderngl

from appliance.outputs.coupling import ROW_S, ROWS
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import palette, stored
from appliance.projector.picture.scene import Easel, Scene, direction
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

ECHOES = 10  # at density 1
KEY_FROM, KEY_ABOVE = -0.9, 40.0  # radians beside the camera, degrees above the floor


class Veil:
    """Draws the figure of glass."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._figure = easel.surface("body", "veil")
        self._echo = easel.surface("body", "veil", coarse=True)
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None:
        """Lay the look onto the wall, over what is there already as far as `opacity` says."""
        easel, colours = self._easel, palette(look)
        picture = easel.picture(wall, look)
        picture.start()
        easel.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        inputs = {
            **scene.inputs,
            "lamp": direction(scene.view.azimuth + KEY_FROM, KEY_ABOVE),
            "light_colour": stored(colours.light),
            "held_colour": stored(colours.held),
        }
        held = easel.held(look)["held"]
        echoes = round(ECHOES * look.density) if look.trail_s > 0 else 0
        rows = min(ROWS - 1, round(look.trail_s / ROW_S))
        for echo in range(echoes, -1, -1):
            share = echo / (echoes + 1)
            inputs |= {
                "row": round(rows * echo / max(echoes, 1)),
                "figure_colour": stored(colours.figure * (1 - share) + colours.accent * share),
                "held": held if echo == 0 else 0.0,
                "brightness": 1.5 if echo == 0 else 0.75 * (1 - share) ** 1.3,
            }
            if echo:
                easel.draw_figures(self._echo, inputs)
                continue
            moments = scene.shutter(wall)
            inputs["brightness"] /= len(moments)
            for back in moments:
                easel.draw_figures(self._figure, inputs | {"back": back})
        picture.finish()
        self._glow.finish(scene, look, colours, picture, opacity, wall)
