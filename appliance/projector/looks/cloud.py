"""Cloud: thousands of grains on the body's surface, which movement shakes off into the air."""

from __future__ import annotations

import moderngl
import numpy as np

from appliance.projector.drawing import Drawing
from appliance.projector.glow import Glow
from appliance.projector.looks.palette import palette
from appliance.projector.particles import LAYOUT, NAMES, particles_of
from appliance.projector.poses import ROW_S, ROWS
from appliance.projector.scene import Easel, Scene, direction
from appliance.show.look import LookConfig

GRAINS = 50000  # at density 1
LOOSE = 0.4  # share of the grains that may leave the body


class Cloud:
    """Draws the figure of dust."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._buffer = easel.ctx.buffer(particles_of(easel.body, GRAINS).packed())
        self._grains = Drawing(easel.ctx, "cloud", "cloud", [(self._buffer, LAYOUT, *NAMES)])
        self._body = easel.surface("body", "depth", coarse=True)
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, target: moderngl.Framebuffer) -> None:
        """Lay the look over what is in the target."""
        easel, view, colours = self._easel, scene.view, palette(look)
        picture = easel.picture(target.size, look.render_scale)
        picture.start()
        picture.keep("")
        easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._body.draw(easel.tally, poses=easel.poses.texture, projection=view.projection, row=0)
        picture.keep("rgba", depth=False)
        easel.ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        self._grains.draw(
            easel.tally,
            moderngl.POINTS,
            round(GRAINS * look.density),
            poses=easel.poses.texture,
            noise=easel.noise,
            projection=view.projection,
            eye=view.eye,
            lamp=direction(view.azimuth - 0.9, 40.0),
            pixels=0.0045 * picture.size[1] / view.slopes[1],
            rows=float(min(ROWS, max(6, round(look.trail_s / ROW_S)))),
            row_s=ROW_S,
            time=scene.time_s % 4096.0,
            loose_share=LOOSE if look.trail_s > 0 else 0.0,
            fog=look.fog,
            focus=float(np.linalg.norm(view.eye - [view.ground[0], 0.5, view.ground[1]])),
            figure_colour=np.sqrt(colours.figure) * 0.5,
            light_colour=np.sqrt(colours.light) * 0.5,
            accent_colour=np.sqrt(colours.accent) * 0.5,
        )
        picture.keep("rgba")
        self._glow.finish(scene, look, colours, picture, opacity, target)

    def release(self) -> None:
        for part in (self._buffer, self._grains, self._body, self._glow):
            part.release()
