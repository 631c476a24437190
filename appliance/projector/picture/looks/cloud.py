"""Cloud: thousands of grains on the body's surface, which movement shakes off into the air."""

from __future__ import annotations

import moderngl

from appliance.outputs.coupling import ROW_S, ROWS
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import palette, stored
from appliance.projector.picture.particles import particles_of
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

GRAINS = 40000  # at density 1
GRAIN = 0.0045  # figure heights across
LOOSE = 0.4  # share of the grains that may leave the body


class Cloud:
    """Draws the figure of dust."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        grains = easel.vertices(particles_of(easel.body, GRAINS))
        self._grains = easel.drawing("cloud", "cloud", grains)
        self._body = easel.surface("body", "depth", coarse=True)
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None:
        """Lay the look onto the wall, over what is there already as far as `opacity` says."""
        easel, view, colours = self._easel, scene.view, palette(look)
        picture = easel.picture(wall, look)
        inputs = {
            **scene.inputs,
            "noise": easel.noise,
            "row": 0,
            "lamp": scene.lamp,
            "pixels": GRAIN * picture.size[1] / view.slopes[1],
            "rows": float(min(ROWS, max(6, round(look.trail_s / ROW_S)))),
            "row_s": ROW_S,
            "loose_share": LOOSE if look.trail_s > 0 else 0.0,
            "fog": look.fog,
            "focus": scene.distance,
            "figure_colour": stored(colours.figure),
            "light_colour": stored(colours.light),
            "accent_colour": stored(colours.accent),
            "held_colour": stored(colours.held),
            **easel.held(look),
        }
        picture.start()
        picture.keep("")
        easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        easel.draw_figures(self._body, inputs)
        picture.keep("rgba", depth=False)
        easel.ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        easel.draw_figures(self._grains, inputs, moderngl.POINTS, round(GRAINS * look.density))
        picture.keep("rgba")
        picture.finish()
        self._glow.finish(scene, look, colours, picture, opacity, wall)
