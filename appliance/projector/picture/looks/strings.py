"""Strings: the answer itself, as the threads of a marionette, and threads between figures that move alike.

They lead up to a control above the hand that holds. Each is taut and bright as far as the joint follows, or
as far as both joints move alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np

from appliance.body.skinning import joint_numbers
from appliance.outputs.joint_frame import Floats
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.projector.picture.drawing import Drawing
from appliance.projector.picture.glow import Glow
from appliance.projector.picture.looks.palette import palette, stored
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.wall import Wall
from appliance.show.look import LookConfig

STEPS = 40  # parts of a string
STRANDS = 2  # threads to each joint at density 1
WIDTH, THINNEST = 1 / 900, 1.5  # half of a thread's: of the picture's height; pixels
CONTROL = 0.25  # figure heights between the control and the picture's upper edge
GLINTS = np.array([-0.7, 0.75, 1.2])  # right, up, towards the camera: a lamp that threads reflect
BODY = 1.2  # brightness of the glass


class Strings:
    """Draws the figure on its strings."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._figure = easel.surface("body", "veil", parts=("LED",))
        self._bones = easel.table(_bones(easel.skeleton.parents, easel.bind_positions))
        joints = tied(Anatomy(easel.skeleton))
        random = np.random.RandomState(13)
        many = np.array([joints[0], *joints * STRANDS])  # fewer strands leave no joint out
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
            "bones": self._bones,
            "brightness": BODY,
            "hides": 0.0,
            "pixel_height": scene.pixel_height(picture.size[1]),
            "pixel": (2 / picture.size[0], 2 / picture.size[1]),
            "width": width,
            "steps": float(STEPS),
            "slack_colour": stored(colours.accent),
            "taut_colour": stored(colours.light),
            "glints_from": _near(scene, GLINTS),
        }
        picture.start()
        easel.ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        moments = scene.shutter(wall)
        for back in moments:
            easel.draw_figures(self._figure, inputs | {"back": back, "brightness": BODY / len(moments)})
        easel.ctx.enable_only(moderngl.BLEND)
        strands = 1 + self._ties * max(1, round(STRANDS * look.density))
        inputs["brightness"] = float(np.sqrt(WIDTH * picture.size[1] / width))
        for figure, leader in enumerate(leaders):
            place = scene.poses.of_figure(figure).positions[0, leader or 0].astype(float)
            inputs |= {
                "leader": -1 if leader is None else leader,
                "leader_at": tuple(easel.bind_positions[leader or 0].tolist()),
                "control": scene.view.over(place, CONTROL),
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


def _bones(parents: Sequence[int], bind_positions: Array) -> Floats:
    """(2, J, 4): planes that say how far a place of the rest pose is along each joint's bone, 0 to 1; where
    the bone ends: the joint itself where several bones begin, or none."""
    table = np.zeros((2, len(parents), 4), np.float32)
    for joint, start in enumerate(bind_positions):
        ends = [child for child, parent in enumerate(parents) if parent == joint]
        table[1, joint, 0] = ends[0] if len(ends) == 1 else joint
        way = bind_positions[ends[0]] - start if len(ends) == 1 else np.zeros(3)
        way = way / max(float(way @ way), 1e-9)
        table[0, joint] = [*way, -way @ start]
    return table


def _near(scene: Scene, off: Array) -> Array:
    """A place that far to the right, up and towards the camera of where the dancer stands."""
    right, (x, z) = scene.view.right, scene.view.ground
    axes = np.stack([right, [0.0, 1.0, 0.0], np.cross(right, [0.0, 1.0, 0.0])])
    return np.asarray(off @ axes + [x, 0.0, z])


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
