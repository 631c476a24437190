"""Masks: what of the display stays dark, like doors and the edges of the set, whatever the picture shows."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Files
from PIL import ImageDraw, ImageFilter

from appliance.projector.picture.drawing import Drawing
from appliance.projector.window import Size
from appliance.show.projector import MaskConfig

FINER = 2  # drawn this many times larger and then shrunk: edges without steps
GHOST = 0.75  # how dark masks are while the grid is on the wall: so that one sees what they hide


class Masks:
    """Darkens the display where the masks of a box file lie, after the picture's corners were placed."""

    def __init__(self, gl: moderngl.Context, masks: Sequence[MaskConfig]) -> None:
        self._gl, self._masks = gl, masks
        self._drawing = Drawing(gl, "screen", "mask") if masks else None
        self._texture: moderngl.Texture | None = None

    def draw(
        self, screen: moderngl.Framebuffer, display: Size, flips: tuple[float, float], is_ghost: bool
    ) -> None:
        """Darken the display. flips: 1 where left and right, top and bottom of the wall are exchanged."""
        if self._drawing is None:
            return
        if self._texture is None or self._texture.size != display:
            self._renew(display)
        screen.use()
        screen.viewport = (0, 0, *display)
        self._gl.enable_only(moderngl.BLEND)
        self._gl.blend_func = moderngl.ZERO, moderngl.ONE_MINUS_SRC_ALPHA
        inputs = {"dark": self._texture, "flips": flips, "strength": GHOST if is_ghost else 1.0}
        self._drawing.draw(inputs)

    def release(self) -> None:
        """Give the GPU's memory back."""
        for owned in (self._drawing, self._texture):
            if owned is not None:
                owned.release()

    def _renew(self, display: Size) -> None:
        if self._texture is not None:
            self._texture.release()
        image = darkness(self._masks, display)
        self._texture = self._gl.texture(display, 1, image.tobytes(), alignment=1)


def darkness(masks: Sequence[MaskConfig], size: Size) -> NDArray[np.uint8]:
    """(height, width) 0..255, top row first: how dark each pixel becomes; overlapping masks: the darkest."""
    width, height = size
    finer = np.array([FINER * width, FINER * height])
    whole = np.zeros((height, width), np.uint8)
    for mask in masks:
        outside = 255 if mask.dark == "outside" else 0
        image = Files.new("L", tuple(finer.tolist()), outside)
        corners = (np.array(mask.points) * finer - 0.5).ravel().tolist()
        ImageDraw.Draw(image).polygon(corners, fill=255 - outside)
        image = image.resize(size, Files.Resampling.BOX)
        if mask.soft > 0.0:
            # Mirrored beyond the display's edge, so that a mask that ends there stays dark up to it.
            image = image.filter(ImageFilter.GaussianBlur(mask.soft * height / 2))
        whole = np.maximum(whole, np.asarray(image))
    return whole
