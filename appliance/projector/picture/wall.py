"""Wall: the surface that a picture is laid onto, its shape and brightness: a texture, or the display."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import numpy as np

from appliance.pose.quaternion import Array

Size = tuple[int, int]

FLAT = np.array([[2.0, 0.0, -1.0], [0.0, 2.0, -1.0], [0.0, 0.0, 1.0]])  # all of the framebuffer, upright


class Detail(NamedTuple):
    """How finely figures are drawn: their resolution, as a share of the picture's, and samples of each pixel
    of their outlines (0: one, in its middle)."""

    scale: float
    samples: int


DETAILS = (Detail(0.7, 0), Detail(1.0, 0), Detail(1.0, 4))  # each takes longer than the one before it


@dataclass(frozen=True)
class Wall:
    """A framebuffer of `display` pixels; the scene is drawn as for a picture of `picture` pixels.

    clip_from_picture: (3, 3), the projective map from the picture's unit square (y up) to clip space, with a
    third row above 0 all over it; the rest of the framebuffer becomes black. level: of the brightness;
    gamma: above 1 lifts the dark tones; finer: how many times finer the figure is drawn than its look says,
    at most as fine as the picture: in a small one its edges would else be steps; detail: of figures
    whose look says none; toe: air that is fainter, as a share of white, is black (0: none).
    """

    framebuffer: moderngl.Framebuffer
    display: Size
    picture: Size
    clip_from_picture: Array
    level: float = 1.0
    gamma: float = 1.0
    finer: float = 1.0
    detail: Detail = DETAILS[0]
    toe: float = 0.0

    @property
    def aspect(self) -> float:
        """Width over height of the picture."""
        return self.picture[0] / self.picture[1]


def flat(framebuffer: moderngl.Framebuffer) -> Wall:
    """All of a framebuffer, as bright as the picture is."""
    return Wall(framebuffer, framebuffer.size, framebuffer.size, FLAT)
