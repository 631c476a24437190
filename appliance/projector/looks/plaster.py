"""Plaster: a sculpted figure in the light of one lamp, with its shadow on the floor and haze in the air."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.pose.quaternion import Array
from appliance.projector.camera import View
from appliance.projector.drawing import Drawing
from appliance.projector.looks.palette import palette
from appliance.projector.scene import Easel, Scene, direction
from appliance.projector.shadow import Shadow
from appliance.show.look import LookConfig

KEY_FROM, KEY_ABOVE = -0.95, 42.0  # radians beside the camera, degrees above the floor
RIM_FROM, RIM_ABOVE = 2.5, 30.0
BEAM = 2.6  # figure heights from the pool of light to the lamp


class Plaster:
    """Draws the plaster figure."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._shadow = Shadow(easel)
        self._figure = easel.surface("body", "plaster")
        self._finish = Drawing(easel.ctx, "air", "plaster_finish")

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
        beam_to, beam_from = (
            _on_picture(view, place, scene.aspect)
            for place in (np.array([view.ground[0], 0.1, view.ground[1]]), _lamp_place(view, lamp))
        )
        easel.finish(target)
        self._finish.draw(
            easel.tally,
            vertices=3,
            **common,
            picture=picture.texture,
            texel=(1 / picture.size[0], 1 / picture.size[1]),
            axes=np.stack([view.right, view.up, view.back], axis=1),
            slopes=view.slopes,
            ground=view.ground,
            air_colour=colours.background,
            beam_from=beam_from,
            beam_to=beam_to,
            beam_width=0.55 / (view.slopes[1] * 2 * np.linalg.norm(view.eye)),
            aspect=scene.aspect,
            fog=look.fog,
            vignette=look.vignette,
            time=scene.time_s % 4096.0,
            opacity=opacity,
        )

    def release(self) -> None:
        for part in (self._shadow, self._figure, self._finish):
            part.release()


def _lamp_place(view: View, lamp: Array) -> Array:
    return np.array([view.ground[0], 0.0, view.ground[1]]) + BEAM * lamp


def _on_picture(view: View, place: Array, aspect: float) -> Array:
    """Where a place appears, in picture heights from the lower left corner."""
    x, y, _, w = view.projection @ [*place, 1.0]
    return np.array([aspect * (0.5 + 0.5 * x / w), 0.5 + 0.5 * y / w])
