"""Draws the dancer: a moment of the dance in one look, or in two that cross-fade, as a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import moderngl

from appliance.pose.ease import ease
from appliance.pose.skeleton import Skeleton
from appliance.projector.moment import Moment
from appliance.projector.picture.camera import NOT_CUED, CuedCamera, Ways, view
from appliance.projector.picture.looks.cloud import Cloud
from appliance.projector.picture.looks.ink import Ink
from appliance.projector.picture.looks.lines import Lines
from appliance.projector.picture.looks.plaster import Plaster
from appliance.projector.picture.looks.strings import Strings
from appliance.projector.picture.looks.veil import Veil
from appliance.projector.picture.poses import poses_of, together
from appliance.projector.picture.scene import Easel, Scene
from appliance.projector.picture.wall import Wall, flat
from appliance.show.look import LookConfig, Style


class _Look(Protocol):
    """A way of drawing; its last pass lays the picture onto the wall with an opacity."""

    def draw(self, scene: Scene, look: LookConfig, opacity: float, wall: Wall) -> None: ...


_LOOKS: dict[Style, Callable[[Easel], _Look]] = {
    "plaster": Plaster,
    "lines": Lines,
    "ink": Ink,
    "cloud": Cloud,
    "veil": Veil,
    "strings": Strings,
}


class Renderer:
    """Owns what the looks need on the GPU; draws any of them into a framebuffer, or right onto the wall.

    looks: by name, at least one, in the show's order; show: its folder, which has the body's surface.
    The same moment makes the same picture, whatever was drawn before, but for the way round that the camera
    goes in a fade; with keeps_strokes ink's paper also shows the strokes of the pictures before it.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        skeleton: Skeleton,
        looks: Mapping[str, LookConfig],
        show: Path | None = None,
        keeps_strokes: bool = False,
    ) -> None:
        self._looks, self._ways = looks, Ways()
        self._easel = Easel(ctx, skeleton, show, melts=any(look.melt > 0.0 for look in looks.values()))
        styles = dict.fromkeys(look.style for look in looks.values())
        self._styles: dict[Style, _Look] = {
            style: Ink(self._easel, keeps_strokes) if style == "ink" else _LOOKS[style](self._easel)
            for style in styles
        }

    def draw(
        self,
        moment: Moment,
        look: str,
        look_before: str,
        mix: float,
        target: Wall | moderngl.Framebuffer,
        cued: CuedCamera = NOT_CUED,
    ) -> None:
        """Draw onto `target`; mix 0: only look_before, 1: only look. Unknown names: the first look.

        While two looks cross-fade, the camera moves from one look's place to the other's, and both draw the
        figure from there, melted as far: its material changes, not its place or shape.
        """
        first = next(iter(self._looks.values()))
        now, before = self._looks.get(look, first), self._looks.get(look_before, first)
        easel = self._easel
        each = [poses_of(moment, puppet, easel.height, easel.sole) for puppet in moment.puppets]
        poses = together(each)
        wall = target if isinstance(target, Wall) else flat(target)
        seen = view(before.camera, now.camera, mix, moment.time_s, poses, wall.aspect, cued, self._ways)
        melt = before.melt + ease(mix) * (now.melt - before.melt)
        scene = Scene(moment.time_s, seen, poses, wall.aspect, melt)
        easel.melt(melt, moment.time_s)
        easel.show(each, [puppet.holds for puppet in moment.puppets])
        layers = [(before, 1.0), (now, mix)] if 0.0 < mix < 1.0 else [(now if mix > 0 else before, 1.0)]
        for layer, opacity in layers:
            self._styles[layer.style].draw(scene, layer, opacity, wall)

    def release(self) -> None:
        """Give the GPU's memory back."""
        self._easel.release()
