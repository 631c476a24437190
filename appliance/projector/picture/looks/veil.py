"""Veil: a figure of glass, and behind it the figures that it has just been."""

from __future__ import annotations

import moderngl

from appliance.outputs.coupling import ROW_S, ROWS
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import palette, stored
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

ECHOES = 10  # at density 1
BRIGHT, ECHO_BRIGHT = 1.8, 1.3
HIDES, ECHO_HIDES = 0.8, 0.3  # else a figure at rest would be as many times too bright as it has echoes


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
        inputs = {
            **scene.inputs,
            "lamp": scene.lamp,
            "light_colour": stored(colours.light),
            "held_colour": stored(colours.held),
            "pixel_height": scene.pixel_height(picture.size[1]),
        }
        held = easel.held(look)["held"]
        echoes = round(ECHOES * look.density) if look.trail_s > 0 else 0
        rows = min(ROWS - 1, round(look.trail_s / ROW_S))

        def draw(back: float) -> None:
            picture.start()
            easel.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
            easel.ctx.blend_equation = moderngl.MAX, moderngl.MAX  # the sum is white where a joint bends
            own = {"row": 0, "held": held, "brightness": BRIGHT, "hides": HIDES, "back": back}
            easel.draw_figures(self._figure, inputs | own | {"figure_colour": stored(colours.figure)})
            easel.ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
            picture.finish()

        picture = easel.expose(picture, scene.shutter(wall), draw)
        picture.use()
        easel.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        easel.ctx.blend_func = moderngl.ONE_MINUS_DST_ALPHA, moderngl.ONE
        for echo in range(1, echoes + 1):  # from the front to the back
            share = echo / (echoes + 1)
            inputs |= {
                "row": round(rows * echo / echoes),
                "figure_colour": stored(colours.figure * (1 - share) + colours.accent * share),
                "held": 0.0,
                "hides": ECHO_HIDES,
                "brightness": ECHO_BRIGHT * (1 - share) ** 1.3,
            }
            easel.draw_figures(self._echo, inputs)
        picture.finish()
        self._glow.finish(scene, look, colours, picture, opacity, wall)
