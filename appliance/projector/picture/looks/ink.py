"""Ink: a brushed silhouette on paper, its echoes, strokes of hands and feet, splashes of sudden moves."""

from __future__ import annotations

from functools import partial
from typing import Any

import moderngl
import numpy as np

from appliance.body.head import head_frame
from appliance.body.rest_pose import anatomy_of
from appliance.outputs.coupling import ROW_S, ROWS
from appliance.outputs.joint_frame import Floats
from appliance.pose.anatomy import Anatomy
from appliance.projector.picture.accents import accents, pressure
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.kept_strokes import KeptStrokes
from appliance.projector.picture.looks.palette import palette
from appliance.projector.picture.particles import traced
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.strands import along_limbs
from appliance.projector.picture.targets import Target, of_lines
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

ECHOES = 5
STROKES, BRUSH = 12, 0.026  # how many points of the body hold a brush, and how wide it is in figure heights
WET = 110  # lines of the picture in which ink spreads
PAPER_LINES = 400  # lines of the sheet, which is made once
SPILL = 0.25  # share of the picture's height that ink reaches beyond the figure: splashes, spreading and pull
SWELL = 0.012  # figure heights between the outlines of a pressed and of a lifted brush
MOST_SPLASHES, DROPS = 8, 26
FACE_SINKS = 4.0  # a melting face is gone after a quarter of the way
PULL = 0.016  # fraction of the picture's height: how far fibres pull the ink


class Ink:
    """Draws the figure of ink."""

    def __init__(self, easel: Easel, keeps: bool = False) -> None:
        """keeps: the paper keeps the strokes of pictures drawn before, as long as time goes on."""
        self._easel, self._keeps = easel, keeps
        self._figure = easel.surface("body", "ink", parts=("BRUSH",))
        self._echo = easel.surface("body", "ink", coarse=True)
        strokes = traced(easel.body, easel.skeleton, easel.bind_positions, STROKES)
        self._strokes = easel.drawing("trail", "stroke", easel.vertices(strokes, instanced=True))
        parts = (f"MOST {MOST_SPLASHES}", f"DROPS {DROPS}")
        self._splashes = easel.drawing("splash", "splash", parts=parts)
        self._head = _head(easel)
        anatomy = Anatomy(easel.skeleton)
        self._ways = easel.table(_brush_ways(easel, anatomy))
        self._ends = [anatomy.chain(first)[-1] for _, first in anatomy.limbs()]
        self._kept = KeptStrokes(easel)
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
        easel.weigh(pressure)
        moments = scene.shutter(wall)
        head = self._head | {"lamp": scene.lamp, "brush_ways": self._ways}
        head["head_drawn"] *= max(0.0, 1.0 - FACE_SINKS * scene.melt)
        inputs["is_light"] = bool(colours.figure.sum() > colours.background.sum())
        head["pixel_height"] = scene.pixel_height(picture.size[1])

        def draw(back: float) -> None:
            picture.start()
            picture.keep("ra")
            easel.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            own = {"row": 0, "level": 1.0, "swell": SWELL, "back": back}
            easel.draw_figures(self._figure, inputs | own | head)
            picture.keep("rgba")
            picture.finish()

        picture = easel.expose(picture, moments, draw)
        lay = None
        if look.trail_s > 0:
            inputs |= self._brush(scene, look.trail_s)
            self._leave_echoes(look.trail_s, inputs, picture)
            picture.keep("b")
            self._leave_strokes(scene, look.trail_s, inputs, picture, 0.9)
            easel.ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
            if self._keeps:
                lay = partial(self._leave_strokes, scene, look.trail_s, inputs)
        picture.keep("rgba")
        picture.finish()
        wet = self._glow.spread(picture, "wet", WET)
        inputs |= {
            "picture": picture.texture,
            "wet_picture": wet.texture,
            "figure_colour": np.sqrt(colours.figure),
            "light_colour": np.sqrt(colours.light),
            "accent_colour": np.sqrt(colours.accent),
            "held_colour": np.sqrt(colours.held),
            "air_colour": np.sqrt(look.exposure * colours.background),
            "paper": self._paper(look, scene.aspect).texture,
            "kept": self._kept.at(scene.time_s, scene.aspect, lay).texture,
            "texel": (1 / picture.size[0], 1 / picture.size[1]),
            "reach": (PULL / scene.aspect, PULL),
            "fog": look.fog,
            "dry": float(len(moments) > 1),
        }
        box = scene.box(ROWS, SPILL) if look.trail_s > 0 else scene.box(margin=SPILL)
        easel.lay("ink_finish", wall, opacity, inputs, box)

    def _paper(self, look: LookConfig, aspect: float) -> Target:
        """The sheet; drawn again when its shape or the look has changed."""
        wanted = {"aspect": aspect, "density": look.density, "vignette": look.vignette}
        sheet = self._easel.canvas("paper", of_lines(PAPER_LINES, aspect))
        if wanted != self._made:
            sheet.start()
            self._easel.ctx.enable_only(moderngl.NOTHING)
            self._sheet.draw(wanted | {"noise": self._easel.noise})
            self._made = wanted
        return sheet

    def _leave_echoes(self, trail_s: float, inputs: dict[str, Any], picture: Target) -> None:
        """Echoes into green; where some overlap the strongest stays."""
        easel, rows = self._easel, _rows(trail_s)
        easel.ctx.enable_only(moderngl.BLEND)
        easel.ctx.blend_equation = moderngl.MAX, moderngl.MAX
        picture.keep("g")
        for echo in range(1, ECHOES + 1):
            inputs |= {
                "row": round((rows - 1) * echo / ECHOES),
                "level": 0.85 * (1 - echo / (ECHOES + 1)) ** 1.2,
                "held": 0.0,
                "roughly": True,
            }
            easel.draw_figures(self._echo, inputs)

    def _brush(self, scene: Scene, trail_s: float) -> dict[str, Any]:
        """The shaders' inputs for strokes and splashes."""
        found = [
            one
            for figure in range(scene.poses.figures)
            for one in accents(scene.poses.of_figure(figure), self._ends, scene.time_s)
        ][:MOST_SPLASHES]
        none = MOST_SPLASHES - len(found)
        return {
            "rows": float(_rows(trail_s)),
            "row_s": ROW_S,
            "floor_side": 1.0,
            "pressure": 1.0,
            "lasts": trail_s,
            "splash_at": [(*one.place.tolist(), one.strength) for one in found] + none * [(0.0,) * 4],
            "splash_way": [(*one.way.tolist(), float(one.seed)) for one in found] + none * [(0.0,) * 4],
            "splash_age": [one.age_s for one in found] + none * [0.0],
        }

    def _leave_strokes(
        self, scene: Scene, trail_s: float, inputs: dict[str, Any], into: Target, brightness: float
    ) -> None:
        """Brush strokes and splashes; where some overlap the strongest stays."""
        height = scene.share_of_picture * into.size[1]
        inputs = inputs | {
            "pixel": (2 / into.size[0], 2 / into.size[1]),
            "width": 0.5 * max(2.0, BRUSH * height),
            "height": height,
            "brightness": brightness,
        }
        rows = _rows(trail_s)
        self._easel.draw_figures(self._strokes, inputs, moderngl.TRIANGLE_STRIP, 2 * rows, STROKES)
        if any(strength for *_, strength in inputs["splash_at"]):
            self._splashes.draw(inputs, moderngl.TRIANGLE_STRIP, 4, MOST_SPLASHES * DROPS)


def _brush_ways(easel: Easel, anatomy: Anatomy) -> Floats:
    """(3, J, 4) planes: how far a place of the rest pose is along each joint's limb, and from its axis to two
    sides, in figure heights."""
    along = along_limbs(easel.skeleton, easel.bind_positions)
    trunk = easel.bind_positions[anatomy.trunk[-1]] - easel.bind_positions[anatomy.trunk[0]]
    if np.linalg.norm(trunk) > 0.0:
        chains = [anatomy.chain(first) for _, first in anatomy.limbs()]
        shoulders = [joint for chain in chains for joint in chain[: anatomy.limb_start(chain)]]
        along[[*anatomy.trunk, *shoulders]] = trunk / np.linalg.norm(trunk)
    aside = np.cross(along, (0.12, 0.1, 1.0))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    axes = np.stack([along, aside, np.cross(along, aside)])
    off = -np.einsum("axj,xj->ax", axes, easel.bind_positions)
    off[0] = 0.0  # along a limb the next joint goes on where this one ends
    return np.concatenate([axes, off[..., None]], axis=2).astype(np.float32)


def _head(easel: Easel) -> dict[str, Any]:
    """The shader's inputs about where the head is in the rest pose, in figure heights."""
    anatomy = anatomy_of(easel.skeleton)
    frame = head_frame(anatomy)
    if frame is None or anatomy.head is None:
        return {"head_at": (0.0, 0.0, 0.0), "head_axes": np.eye(3), "head_drawn": 0.0}
    middle, axes = frame
    above = (middle - anatomy.positions[anatomy.head]) / anatomy.height
    at = easel.bind_positions[anatomy.head] + above
    return {"head_at": tuple(at.tolist()), "head_axes": axes, "head_drawn": 1.0}


def _rows(trail_s: float) -> int:
    return min(ROWS, max(6, round(trail_s / ROW_S)))
