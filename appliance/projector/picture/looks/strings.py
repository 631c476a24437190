"""Strings: the answer itself, from the held joint to each limb, and between figures that move alike.

Each is taut as far as the limb follows, or as far as both joints move alike.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from appliance.body.skinning import joint_numbers
from appliance.pose.anatomy import Anatomy
from appliance.projector.picture.drawing import Drawing
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import palette, stored
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

STEPS = 40  # parts of a string
STRANDS = 7  # in each limb's string at density 1
WIDTH, THINNEST = 1 / 560, 1.2  # half of a strand's: of the picture's height; pixels
ABOVE = 1.5  # figure heights: where strings hang from while no hand holds a joint
BODY = 1.0  # brightness of the glass


class Strings:
    """Draws the figure on its strings."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._figure = easel.surface("body", "veil", parts=("LED",))
        joints = tied(Anatomy(easel.skeleton))
        random = np.random.RandomState(13)
        many = np.tile(np.array(joints), STRANDS)  # fewer strands leave no joint out
        self._ties = len(joints)
        parts = {
            "position": easel.bind_positions[many].astype(np.float32),
            "chance": random.random_sample((len(many), 4)).astype(np.float32),
            "joints": joint_numbers(np.repeat(many[:, None], 4, axis=1), len(easel.skeleton)),
        }
        self._tied_to = easel.vertices(parts, instanced=True)
        self._strings = easel.drawing("string", "string", self._tied_to)
        self._between: Drawing | None = None  # most shows have one figure
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None:
        """Lay the look onto the wall, over what is there already as far as `opacity` says."""
        easel, colours = self._easel, palette(look)
        leaders = easel.lead()
        picture = easel.picture(wall, look)
        width = max(THINNEST, WIDTH * picture.size[1])
        inputs: dict[str, Any] = {
            **scene.inputs,
            "lamp": scene.lamp,
            "row": 0,
            "light_colour": stored(colours.light),
            "figure_colour": stored(colours.figure),
            "held_colour": stored(colours.held),
            "held": look.held.strength,
            "brightness": BODY,
            "hides": 0.0,
            "pixel_height": scene.pixel_height(picture.size[1]),
            "pixel": (2 / picture.size[0], 2 / picture.size[1]),
            "width": width,
            "steps": float(STEPS),
            "slack_colour": stored(colours.accent),
            "taut_colour": stored(colours.light),
        }
        picture.start()
        easel.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        moments = scene.shutter(wall)
        for back in moments:
            easel.draw_figures(self._figure, inputs | {"back": back, "brightness": BODY / len(moments)})
        easel.ctx.enable_only(moderngl.BLEND)
        strands = self._ties * max(1, round(STRANDS * look.density))
        for figure, leader in enumerate(leaders):
            root = scene.poses.each_root[0, figure]
            inputs |= {
                "leader": -1 if leader is None else leader,
                "leader_at": tuple(easel.bind_positions[leader or 0].tolist()),
                "above": (float(root[0]), ABOVE, float(root[2])),
                "brightness": WIDTH * picture.size[1] / width,
            }
            easel.draw_figure(
                figure, self._strings, inputs, moderngl.TRIANGLE_STRIP, 2 * (STEPS + 1), strands
            )
        for first, pair in easel.couplings():
            if self._between is None:
                self._between = easel.drawing("string", "string", self._tied_to, parts=("BETWEEN",))
            easel.draw_figure(
                *(first, self._between, inputs | pair | {"leader": -1}),
                *(moderngl.TRIANGLE_STRIP, 2 * (STEPS + 1), strands),
            )
        picture.finish()
        self._glow.finish(scene, look, colours, picture, opacity, wall)


def tied(anatomy: Anatomy) -> list[int]:
    """The joints that strings are tied to: limbs from elbow and knee on, chest, hips and head; of a skeleton
    without limbs all."""
    joints: list[int] = []
    for _, first in anatomy.limbs():
        chain = anatomy.chain(first)
        joints += chain[anatomy.limb_start(chain) + 1 :]
    if not joints:
        return list(range(len(anatomy.skeleton)))
    spine = [anatomy.trunk[0], anatomy.trunk[-1], *([] if anatomy.head is None else [anatomy.head])]
    return list(dict.fromkeys([*joints, *spine]))
