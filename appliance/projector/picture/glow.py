"""Glow: light that spills around bright parts, computed in small pictures; and the dark room around it."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.projector.picture.looks.palette import Palette
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.shadow import OVERHEAD, Shadow
from appliance.projector.picture.targets import Target, of_lines
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

NEAR, FAR = 180, 60  # lines of the glow's pictures
FAR_GAIN = 2.0  # the far glow is faint


class Glow:
    """The last step of the looks that are light in the dark."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._shrink = easel.drawing("screen", "glow_shrink")
        self._blur = easel.drawing("screen", "glow_blur")
        self._air = easel.drawing("air", "light_air")
        self._shadow = Shadow(easel)

    def spread(self, picture: Target, name: str, lines: int, gain: float = 1.0) -> Target:
        """A small, soft copy of a picture, `gain` times as bright."""
        easel = self._easel
        easel.ctx.enable_only(moderngl.NOTHING)
        size = of_lines(lines, picture.size[0] / picture.size[1])
        first, second = easel.canvas(name, size), easel.canvas(name + " half", size)
        first.start()
        inputs = {"source": picture.texture, "texel": (0.25 / size[0], 0.25 / size[1]), "gain": gain}
        self._shrink.draw(inputs)
        easel.blur(self._blur, first, second, (1 / size[0], 1 / size[1]))
        return first

    def finish(
        self,
        scene: Scene,
        look: LookConfig,
        colours: Palette,
        picture: Target,
        opacity: float,
        wall: Wall,
        mirror: float = 1.0,
    ) -> None:
        """Lay the picture with its glow onto the wall; mirror: how clear the floor mirrors it."""
        easel, view = self._easel, scene.view
        near = self.spread(picture, "near glow", NEAR)
        far = self.spread(near, "far glow", FAR, FAR_GAIN)
        air = easel.canvas("air", near.size)
        inputs = {
            **scene.inputs,
            **self._easel.behind(look),
            "picture": picture.texture,
            "near_glow": near.texture,
            "far_glow": far.texture,
            "air": air.texture,
            "noise": easel.noise,
            **self._shadow.on_floor(scene, OVERHEAD),
            "figure_light": look.shadow * colours.figure,
            "mirror": mirror * look.shadow,
            "heart": view.on_picture(np.array([view.ground[0], 0.5, view.ground[1]])),
            "air_colour": colours.background,
            "fog": look.fog,
            "glow": look.glow,
            "vignette": look.vignette,
            "toe": wall.toe,
            "exposure": look.exposure,
        }
        air.start()
        self._air.draw(inputs)
        easel.lay("light_finish", wall, opacity, inputs)
