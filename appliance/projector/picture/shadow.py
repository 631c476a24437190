"""Shadows: what the lamp sees of the dancer, and what the dancer keeps off the floor."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from appliance.pose.quaternion import Array
from appliance.projector.picture.scene import Easel, Scene

DEPTH_SIDE, CAST_SIDE = 384, 192  # pixels
FIELD = 0.85  # figure heights around the dancer's middle that the lamp sees
REACH = 1.7  # figure heights of floor around the dancer on which a shadow can fall
OVERHEAD = np.array([0.0, 1.0, 0.0])  # what is near the floor darkens it right below, whatever the lamp


class Shadow:
    """The key lamp's shadow on the body (a picture of depths) and on the floor (soft with height)."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        self._depth = easel.surface("body", "depth", coarse=True)
        self._cast = easel.surface("cast", "cast", coarse=True)
        self._blur = easel.drawing("screen", "cast_blur")

    def draw(self, scene: Scene, lamp: Array) -> dict[str, Any]:
        """Draw both for a lamp in that direction; returns what shaders that receive shadows need."""
        ctx, easel = self._easel.ctx, self._easel
        root, side = scene.poses.roots[0].astype(float), round(scene.spread * DEPTH_SIDE)
        middle = np.array([root[0], max(0.5, root[1]), root[2]])
        lamp_projection = _orthographic(lamp, middle, scene.spread * FIELD, side)
        depth = easel.canvas("lamp depth", (side, side), depth=True)
        depth.start((1.0, 1.0, 1.0, 1.0))
        ctx.enable_only(moderngl.DEPTH_TEST)
        easel.draw_figures(
            self._depth, {"row": 0, "held": 0.0, "roughly": True, "projection": lamp_projection}
        )
        depth.finish()
        lamps = {"lamp_depth": depth.texture, "lamp_projection": lamp_projection}
        below = self.on_floor(scene, OVERHEAD, "contact")
        lamps |= {"contact": below["floor_shadow"], "contact_middle": below["middle"]}
        return lamps | self.on_floor(scene, lamp)

    def on_floor(self, scene: Scene, lamp: Array, name: str = "cast") -> dict[str, Any]:
        """Draw only the floor's shadow; name: of its canvas."""
        ctx, easel = self._easel.ctx, self._easel
        root, side = scene.poses.roots[0].astype(float), round(scene.spread * CAST_SIDE)
        middle = root[[0, 2]] - 0.5 * lamp[[0, 2]] / lamp[1]
        on_floor = {"lamp": lamp, "middle": middle, "reach": scene.spread * REACH}
        first, second = (easel.canvas(name, (side, side)) for name in (name, "cast blurred"))
        first.start()
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_equation = moderngl.MAX, moderngl.MAX
        easel.draw_figures(self._cast, {"row": 0, "held": 0.0, "roughly": True, **on_floor})
        ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        ctx.enable_only(moderngl.NOTHING)
        easel.blur(self._blur, first, second, (1 / side, 1 / side))
        return {"floor_shadow": first.texture, "middle": middle, "reach": on_floor["reach"]}


def _orthographic(lamp: Array, centre: Array, field: float, side: int) -> Array:
    """(4, 4) from figure heights to the lamp's picture of that many pixels, which shows `field` around the
    centre; it moves in whole pixels, so that edges stay calm.
    """
    right = np.cross([0.0, 1.0, 0.0], lamp)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(lamp, right), lamp])
    pixel = 2 * field / side
    middle = np.round(axes @ centre / pixel) * pixel
    look = np.eye(4)
    look[:3, :3], look[:3, 3] = axes / field, -middle / field
    look[2] *= -0.5  # depth grows away from the lamp
    return look
