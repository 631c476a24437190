"""Lines: strands of light along the limbs, the ways that hands and feet have gone, a floor that mirrors."""

from __future__ import annotations

from typing import Any

import moderngl

from appliance.outputs.coupling import ROW_S, ROWS
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import Palette, palette, stored
from appliance.projector.picture.particles import traced
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.strands import POINTS, ribbons_of
from appliance.projector.picture.targets import Target
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

ECHOES = 5
TRACES = 56  # points of the body that leave a trail
WIDTH = 1 / 420  # half of a strand's, of the picture's height
THINNEST = 1.4  # pixels: half of the thinnest strand that has no gaps
MIRROR = 0.35  # fraction of the light that comes back from the floor


class Lines:
    """Draws the figure of light."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        parts, indices, self._count = ribbons_of(easel.body, easel.skeleton, easel.bind_positions)
        self._strands = easel.drawing("strand", "strand", easel.vertices(parts), easel.indices(indices))
        traces = traced(easel.body, easel.skeleton, easel.bind_positions, TRACES)
        self._trails = easel.drawing("trail", "trail", easel.vertices(traces, instanced=True))
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None:
        """Lay the look onto the wall, over what is there already as far as `opacity` says."""
        easel, colours = self._easel, palette(look)
        picture = easel.picture(wall, look)
        picture.start()
        easel.ctx.enable_only(moderngl.BLEND)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        for side, share in ((-1.0, MIRROR * look.shadow), (1.0, 1.0)):
            if share > 0:
                self._figure(scene, look, colours, picture, side, share)
        picture.finish()
        self._glow.finish(scene, look, colours, picture, opacity, wall, mirror=0.0)

    def _figure(
        self, scene: Scene, look: LookConfig, colours: Palette, picture: Target, side: float, share: float
    ) -> None:
        """The strands with their trails; side -1: as the floor mirrors them; share: of the brightness."""
        width = max(THINNEST, WIDTH * picture.size[1])
        share *= WIDTH * picture.size[1] / width  # as much light from a small picture as from a large one
        inputs: dict[str, Any] = {
            **scene.inputs,
            "pixel": (2 / picture.size[0], 2 / picture.size[1]),
            "floor_side": side,
            "width": width,
            "far_colour": stored(colours.accent),
            "held_colour": stored(colours.held),
            "held": 0.0,
        }
        if look.trail_s > 0:
            self._leave_traces(look, colours, inputs, share)
        inputs |= {"row": 0, "near_colour": stored(colours.figure), "brightness": 1.2 * share}
        inputs |= self._easel.held(look)
        self._draw_strands(inputs, look.density)

    def _leave_traces(self, look: LookConfig, colours: Palette, inputs: dict[str, Any], share: float) -> None:
        """Ribbons where hands and feet have gone; above the floor also some strands where they have been."""
        rows = min(ROWS, max(2, round(look.trail_s / ROW_S)))
        trail = {
            "width": 1.3 * inputs["width"],
            "rows": float(rows),
            "row_s": ROW_S,
            "fresh_colour": stored(colours.light),
            "old_colour": stored(colours.accent),
            "brightness": 0.8 * share,
            "pressure": 0.0,
        }
        self._easel.draw_figures(self._trails, inputs | trail, moderngl.TRIANGLE_STRIP, 2 * rows, TRACES)
        echoes = ECHOES if inputs["floor_side"] > 0 else 0
        for echo in range(echoes, 0, -1):
            age = echo / (echoes + 1)
            inputs |= {
                "row": round(0.8 * (rows - 1) * age),
                "near_colour": stored(colours.accent),
                "brightness": 0.5 * share * (1 - age) ** 1.5,
            }
            self._draw_strands(inputs, 0.4 * look.density)

    def _draw_strands(self, inputs: dict[str, Any], part: float) -> None:
        """The first part of all strands."""
        count = round(part * self._count) * POINTS * 6
        self._easel.draw_figures(self._strands, inputs, moderngl.TRIANGLES, count)
