"""Draws the dancer: a moment of the dance in one look, or in two that cross-fade, as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl

from appliance.pose.skeleton import Skeleton
from appliance.projector.camera import view
from appliance.projector.looks.cloud import Cloud
from appliance.projector.looks.ink import Ink
from appliance.projector.looks.lines import Lines
from appliance.projector.looks.plaster import Plaster
from appliance.projector.looks.veil import Veil
from appliance.projector.moment import Moment
from appliance.projector.poses import poses_of
from appliance.projector.scene import Easel, Scene
from appliance.show.look import LookConfig


@dataclass(frozen=True)
class Figures:
    """What one frame costs."""

    draw_calls: int
    triangles: int
    overdraw: float
    gpu_bytes: int


class Renderer:
    """Owns what the looks need on the GPU; draws any of them into a framebuffer of the given size."""

    def __init__(
        self,
        ctx: moderngl.Context,
        size: tuple[int, int],
        skeleton: Skeleton,
        looks: Mapping[str, LookConfig],
    ) -> None:
        self.ctx, self.size, self.looks = ctx, size, looks
        self._easel = Easel(ctx, skeleton)
        self._styles = {
            "plaster": Plaster(self._easel),
            "lines": Lines(self._easel),
            "cloud": Cloud(self._easel),
            "ink": Ink(self._easel),
            "veil": Veil(self._easel),
        }

    def draw(
        self, moment: Moment, look: str, look_before: str, mix: float, target: moderngl.Framebuffer
    ) -> None:
        """Draw into `target`; mix 0: only look_before, 1: only look. Unknown names: the first look."""
        first = next(iter(self.looks.values()))
        now, before = self.looks.get(look, first), self.looks.get(look_before, first)
        poses = poses_of(moment, self._easel.height, self._easel.sole)
        aspect = target.size[0] / target.size[1]
        seen = view(now.camera, before.camera, mix, moment.time_s, poses, aspect)
        scene = Scene(moment.time_s, seen, poses, aspect, moment.held)
        self._easel.poses.write(poses)
        layers = [(before, 1.0), (now, mix)] if 0.0 < mix < 1.0 else [(now if mix else before, 1.0)]
        for layer, opacity in layers:
            self._styles[layer.style].draw(scene, layer, opacity, target)

    def resize(self, size: tuple[int, int]) -> None:
        """The picture's size in pixels from the next draw on."""
        self.size = size

    def figures(self) -> Figures:
        """What the last frame cost."""
        return Figures(self._easel.tally.draw_calls, 0, 0, self._easel.bytes)

    def release(self) -> None:
        """Give the GPU's memory back."""
