"""Draws the dancer: a moment of the dance in one look, or in two that cross-fade, as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl

from appliance.pose.skeleton import Skeleton
from appliance.projector.moment import Moment
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
        self.ctx, self.size, self.skeleton, self.looks = ctx, size, skeleton, looks

    def draw(
        self, moment: Moment, look: str, look_before: str, mix: float, target: moderngl.Framebuffer
    ) -> None:
        """Draw into `target`; mix 0: only look_before, 1: only look. Unknown names: the first look."""

    def resize(self, size: tuple[int, int]) -> None:
        """The picture's size in pixels from the next draw on."""

    def figures(self) -> Figures:
        """What the last frame cost."""

    def release(self) -> None:
        """Give the GPU's memory back."""
