"""Lines: strands of light along the limbs, the ways that hands and feet have gone, a floor that mirrors them."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from appliance.projector.drawing import Drawing
from appliance.projector.glow import Glow
from appliance.projector.looks.palette import Palette, palette
from appliance.projector.particles import LAYOUT, NAMES
from appliance.projector.poses import ROW_S, ROWS
from appliance.projector.scene import Easel, Scene
from appliance.projector.strands import POINTS, Strands, reach_of, strands_of
from appliance.projector.trails import traced
from appliance.show.look import LookConfig

ECHOES = 5
TRACES = 56  # points of the body that leave a trail
STRAND_LAYOUT = "3f4 3f4 3f4 3f4 4u1 4f4"
STRAND_NAMES = ("in_position", "in_tangent", "in_normal", "in_along", "in_joints", "in_weights")


class Lines:
    """Draws the figure of light."""

    def __init__(self, easel: Easel) -> None:
        self._easel = easel
        strands = strands_of(easel.body, easel.skeleton, easel.bind_positions)
        vertices, indices = _ribbons(strands)
        self._buffers = [easel.ctx.buffer(vertices), easel.ctx.buffer(indices)]
        self._strands = Drawing(
            easel.ctx,
            "strand",
            "strand",
            [(self._buffers[0], STRAND_LAYOUT, *STRAND_NAMES)],
            self._buffers[1],
        )
        self._buffers.append(
            easel.ctx.buffer(
                traced(easel.body, reach_of(easel.skeleton, easel.bind_positions), TRACES).packed()
            )
        )
        self._trails = Drawing(easel.ctx, "trail", "trail", [(self._buffers[2], LAYOUT + "/i", *NAMES)])
        self._glow = Glow(easel)

    def draw(self, scene: Scene, look: LookConfig, opacity: float, target: moderngl.Framebuffer) -> None:
        """Lay the look over what is in the target."""
        easel, colours = self._easel, palette(look)
        picture = easel.picture(target.size, look.render_scale)
        picture.start()
        easel.ctx.enable_only(moderngl.BLEND)
        easel.ctx.blend_func = moderngl.ONE, moderngl.ONE
        for side, share in ((-1.0, 0.35 * look.shadow), (1.0, 1.0)):
            if share > 0:
                self._figure(scene, look, colours, picture.size, side, share)
        self._glow.finish(scene, look, colours, picture, opacity, target)

    def _figure(
        self,
        scene: Scene,
        look: LookConfig,
        colours: Palette,
        size: tuple[int, int],
        side: float,
        share: float,
    ) -> None:
        easel = self._easel
        common: dict[str, Any] = {
            "poses": easel.poses.texture,
            "projection": scene.view.projection,
            "eye": scene.view.eye,
            "pixel": (2 / size[0], 2 / size[1]),
            "floor_side": side,
        }
        rows = max(2, round(look.trail_s / ROW_S))
        width = max(1.4, size[1] / 420)
        figure, accent = np.sqrt(colours.figure) * 0.5, np.sqrt(colours.accent) * 0.5
        if look.trail_s > 0:
            self._trails.draw(
                easel.tally, moderngl.TRIANGLE_STRIP, 2 * min(rows, ROWS), TRACES, **common, width=1.3 * width,
                rows=min(rows, ROWS), row_s=ROW_S, fresh_colour=np.sqrt(colours.light) * 0.5, old_colour=accent, brightness=0.8 * share,
            )  # fmt: skip
            for echo in range(ECHOES, 0, -1):
                row = round(min(rows, ROWS - 1) * echo / ECHOES * 0.7)
                self._strands.draw(
                    easel.tally, **common, width=width, row=row, near_colour=accent, far_colour=accent,
                    share=0.4 * look.density, brightness=0.5 * share * (1 - echo / (ECHOES + 1)) ** 1.5,
                )  # fmt: skip
        self._strands.draw(
            easel.tally, **common, width=width, row=0, near_colour=figure, far_colour=accent,
            share=look.density, brightness=1.2 * share,
        )  # fmt: skip

    def release(self) -> None:
        for part in (self._strands, self._trails, self._glow, *self._buffers):
            part.release()


def _ribbons(strands: Strands) -> tuple[bytes, bytes]:
    """Vertices, two a point, and indices of the triangles between them."""
    count = len(strands.positions)
    kinds = [("p", "f4", 3), ("t", "f4", 3), ("n", "f4", 3), ("a", "f4", 3), ("j", "u1", 4), ("w", "f4", 4)]
    records = np.zeros((count, POINTS + 1, 2), kinds)
    for name, values in zip(
        "ptnjw",
        (strands.positions, strands.tangents, strands.normals, strands.joints, strands.weights),
        strict=True,
    ):
        records[name] = values[:, :, None]
    chances = np.random.RandomState(5).random_sample((count, 1))
    records["a"][..., 0] = [-1.0, 1.0]
    records["a"][..., 1] = strands.strengths[..., None]
    records["a"][..., 2] = chances[..., None]
    first = (2 * np.arange(count * (POINTS + 1)).reshape(count, POINTS + 1)[:, :-1]).reshape(-1, 1)
    indices = first + np.array([[0, 1, 2, 1, 3, 2]])
    return records.tobytes(), indices.astype(np.int32).tobytes()
