"""Ink: a brushed silhouette on paper, its echoes of the last second, and the strokes of hands and feet."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import palette
from appliance.projector.picture.particles import traced
from appliance.projector.picture.poses import ROW_S, ROWS
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.targets import Target
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

ECHOES = 5
STROKES, BRUSH = 12, 0.026  # how many points of the body hold a brush, and how wide it is in figure heights
WET = 180  # lines of the picture in which ink spreads
PAPER_LINES = 400  # lines of the sheet, which is made once
SPILL = 0.07  # share of the picture's height that ink reaches beyond the figure: brush, spreading and pull
PULL = 0.016  # fraction of the picture's height: how far fibres pull the ink


class Ink:
    """Draws the figure of ink."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._figure = easel.surface("body", "ink")
        self._echo = easel.surface("body", "ink", coarse=True)
        strokes = traced(easel.body, easel.skeleton, easel.bind_positions, STROKES)
        self._strokes = easel.drawing("trail", "stroke", easel.vertices(strokes, instanced=True))
        self._glow = Glow(easel)
        self._sheet = easel.drawing("screen", "paper")
        self._made: dict[str, float] = {}

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None:
        """Lay the look onto the wall, over what is there already as far as `opacity` says."""
        easel, colours = self._easel, palette(look)
        picture = easel.picture(wall, look)
        inputs: dict[str, Any] = {
            **scene.inputs,
            **easel.held(look),
            **easel.behind(look),
            "noise": easel.noise,
        }
        picture.start()
        picture.keep("ra")
        easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        easel.draw_figures(self._figure, inputs | {"row": 0, "level": 1.0, "hollow": 1.0})
        if look.trail_s > 0:
            self._leave_traces(scene, look.trail_s, inputs, picture)
        picture.keep("rgba")
        picture.finish()
        wet = self._glow.spread(picture, "near glow", WET)
        inputs |= {
            "picture": picture.texture,
            "wet_picture": wet.texture,
            "figure_colour": np.sqrt(colours.figure),
            "light_colour": np.sqrt(colours.light),
            "accent_colour": np.sqrt(colours.accent),
            "held_colour": np.sqrt(colours.held),
            "air_colour": np.sqrt(look.exposure * colours.background),
            "paper": self._paper(look, scene.aspect).texture,
            "texel": (1 / picture.size[0], 1 / picture.size[1]),
            "reach": (PULL / scene.aspect, PULL),
            "fog": look.fog,
        }
        box = scene.box(ROWS, SPILL) if look.trail_s > 0 else scene.box(margin=SPILL)
        easel.lay("ink_finish", wall, opacity, inputs, box)

    def _paper(self, look: LookConfig, aspect: float) -> Target:
        """The sheet; drawn again when its shape or the look has changed."""
        wanted = {"aspect": aspect, "density": look.density, "vignette": look.vignette}
        sheet = self._easel.canvas("paper", (round(PAPER_LINES * aspect), PAPER_LINES))
        if wanted != self._made:
            sheet.start()
            self._easel.ctx.enable_only(moderngl.NOTHING)
            self._sheet.draw(wanted | {"noise": self._easel.noise})
            self._made = wanted
        return sheet

    def _leave_traces(self, scene: Scene, trail_s: float, inputs: dict[str, Any], picture: Target) -> None:
        """Echoes into green, brush strokes into blue; where some overlap the strongest stays."""
        easel = self._easel
        rows = min(ROWS, max(6, round(trail_s / ROW_S)))
        easel.ctx.enable_only(moderngl.BLEND)
        easel.ctx.blend_equation = moderngl.MAX, moderngl.MAX
        picture.keep("g")
        for echo in range(1, ECHOES + 1):
            inputs |= {
                "row": round((rows - 1) * echo / ECHOES),
                "level": 0.85 * (1 - echo / (ECHOES + 1)) ** 1.2,
                "hollow": 0.0,
                "held": 0.0,
            }
            easel.draw_figures(self._echo, inputs)
        picture.keep("b")
        brush = max(2.0, BRUSH * scene.share_of_picture * picture.size[1])
        inputs |= {
            "pixel": (2 / picture.size[0], 2 / picture.size[1]),
            "width": 0.5 * brush,
            "rows": float(rows),
            "row_s": ROW_S,
            "floor_side": 1.0,
            "brightness": 0.9,
            "pressure": 1.0,
        }
        easel.draw_figures(self._strokes, inputs, moderngl.TRIANGLE_STRIP, 2 * rows, STROKES)
        easel.ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
