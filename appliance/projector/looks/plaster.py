"""Plaster: a sculpted figure in the light of one lamp, with its shadow on the floor and haze in the air."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.projector.drawing import Drawing
from appliance.projector.looks.palette import palette
from appliance.projector.scene import Easel, Scene, direction
from appliance.projector.shadow import Shadow
from appliance.show.look import LookConfig

KEY_FROM, KEY_ABOVE = -1.0, 54.0  # radians beside the camera, degrees above the floor
RIM_FROM, RIM_ABOVE = 2.25, 24.0
AIR_LINES = 360  # of the picture of the empty stage: all that is in it is soft
BEAM = 2.4  # figure heights from the pool of light to the lamp


class Plaster:
    """Draws the plaster figure."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._shadow = Shadow(easel)
        self._figure = easel.surface("body", "plaster")
        self._air = Drawing(easel.ctx, "air", "plaster_air")
        self._finish = Drawing(easel.ctx, "screen", "plaster_finish")

    def draw(self, scene: Scene, look: LookConfig, opacity: float, target: moderngl.Framebuffer) -> None:
        """Lay the look over what is in the target."""
        easel, view, colours = self._easel, scene.view, palette(look)
        lamp = direction(view.azimuth + KEY_FROM, KEY_ABOVE)
        common = {
            **self._shadow.draw(scene, lamp),
            "noise": easel.noise,
            "eye": view.eye,
            "light_colour": colours.light,
            "accent_colour": colours.accent,
            "shadow": look.shadow,
            "exposure": look.exposure,
        }
        picture = easel.picture(target.size, look.render_scale)
        picture.start()
        easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._figure.draw(
            easel.tally,
            **common,
            poses=easel.poses.texture,
            projection=view.projection,
            row=0,
            lamp=lamp,
            back_lamp=direction(view.azimuth + RIM_FROM, RIM_ABOVE),
            figure_colour=colours.figure,
        )
        pool = np.array([view.ground[0], 0.0, view.ground[1]])
        air = easel.canvas("air", (round(AIR_LINES * scene.aspect), AIR_LINES))
        air.start()
        easel.ctx.enable_only(moderngl.NOTHING)
        self._air.draw(
            easel.tally,
            vertices=3,
            **common,
            axes=np.stack([view.right, view.up, view.back], axis=1),
            slopes=view.slopes,
            ground=view.ground,
            air_colour=colours.background,
            beam_from=view.on_picture(pool + BEAM * lamp),
            beam_to=view.on_picture(pool),
            beam_width=0.42 / (view.slopes[1] * 2 * np.linalg.norm(view.eye - pool)),
            aspect=scene.aspect,
            fog=look.fog,
            time=scene.time_s % 4096.0,
        )
        easel.finish(target)
        self._finish.draw(
            easel.tally,
            vertices=3,
            picture=picture.texture,
            air=air.texture,
            texel=(1 / picture.size[0], 1 / picture.size[1]),
            box=scene.box,
            aspect=scene.aspect,
            vignette=look.vignette,
            opacity=opacity,
        )

    def release(self) -> None:
        for part in (self._shadow, self._figure, self._air, self._finish):
            part.release()
