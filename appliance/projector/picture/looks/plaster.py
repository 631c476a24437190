"""Plaster: a sculpted figure in the light of one lamp, with its shadow on the floor and haze in the air."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.projector.picture.looks.palette import palette
from appliance.projector.picture.scene import Easel, Scene, direction
from appliance.projector.picture.shadow import Shadow
from appliance.projector.picture.targets import of_lines
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

KEY_FROM, KEY_ABOVE = -1.35, 44.0  # radians beside the camera, degrees above the floor
RIM_FROM, RIM_ABOVE = 2.25, 24.0
AIMED = 0.22  # figure heights above the floor: where the lamp's beam crosses the dancer
BEAM, BEAM_WIDTH = 2.4, 0.42  # figure heights from the pool of light to the lamp, and across the pool
AIR_LINES = 180  # lines of the picture of the empty stage, which is soft everywhere


class Plaster:
    """Draws the plaster figure."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._shadow = Shadow(easel)
        self._figure = easel.surface("body", "plaster")
        self._air = easel.drawing("air", "plaster_air")

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None:
        """Lay the look onto the wall, over what is there already as far as `opacity` says."""
        easel, view, colours = self._easel, scene.view, palette(look)
        lamp = direction(view.azimuth + KEY_FROM, KEY_ABOVE)
        inputs = {
            **scene.inputs,
            **self._shadow.draw(scene, lamp),
            "noise": easel.noise,
            "row": 0,
            "lamp": lamp,
            "back_lamp": direction(view.azimuth + RIM_FROM, RIM_ABOVE),
            "figure_colour": colours.figure,
            "light_colour": colours.light,
            "accent_colour": colours.accent,
            "held_colour": colours.held,
            **easel.held(look),
            **easel.behind(look),
            "air_colour": colours.background,
            "shadow": look.shadow,
            "fog": look.fog,
            "exposure": look.exposure,
            "vignette": look.vignette,
            "toe": wall.toe,
        }
        picture = easel.picture(wall, look)

        def draw(back: float) -> None:
            picture.start()
            easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            easel.draw_figures(self._figure, inputs | {"back": back})
            picture.finish()

        exposed = easel.expose(picture, scene.shutter(wall), draw)
        pool = np.array([view.ground[0], 0.0, view.ground[1]]) - AIMED * lamp * [1.0, 0.0, 1.0] / lamp[1]
        inputs |= {
            "pool_at": pool[[0, 2]],
            "beam_from": view.on_picture(pool + BEAM * lamp),
            "beam_to": view.on_picture(pool),
            "beam_width": scene.spread * BEAM_WIDTH * scene.share_of_picture,
        }
        air = easel.canvas("stage", of_lines(AIR_LINES, scene.aspect))
        air.start()
        easel.ctx.enable_only(moderngl.NOTHING)
        self._air.draw(inputs)
        inputs |= {
            "picture": exposed.texture,
            "air": air.texture,
            "texel": (1 / picture.size[0], 1 / picture.size[1]),
        }
        easel.lay("plaster_finish", wall, opacity, inputs, scene.box())
