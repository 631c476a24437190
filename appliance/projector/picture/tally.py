"""Tally: what a picture takes, counted, and the time that it takes on a Raspberry Pi 4, reckoned."""

from __future__ import annotations

from dataclasses import dataclass

# A Raspberry Pi 4's GPU, the VideoCore VI, has 8 units of 4 lanes with a multiplication and an addition a
# cycle at 500 MHz: 32 thousand million operations a second at most. What shaders get is taken from glmark2
# on a Raspberry Pi 5 (12 units, 960 MHz): effect2d with 25 samples a pixel, 10 operations each, takes 2.2 ms
# more at 800x600 than an empty picture. For the units and the clock of the 4 that makes 14 thousand million
# operations and 1.4 thousand million samples a second. Of its memory's 12.8 GB/s a third is for the GPU.
_OPERATIONS_S, _FETCHES_S, _BYTES_S = 14e9, 1.4e9, 4e9
_DRAW_CALL_S = 30e-6  # of the driver, state and uniforms included
_VERTEX_PASSES = 2  # the GPU goes over vertices twice: for where they are, and to draw them
_BYTES_A_PIXEL = 4.0  # what a pixel writes; tiles keep depth and blending off the memory

# Operations and texture fetches of each fragment shader for a pixel and of each vertex shader for a vertex,
# counted by hand in their main paths.
_FRAGMENT = {
    "depth": (8, 0),
    "cast": (12, 0),
    "cast_blur": (90, 13),
    "plaster": (230, 10),
    "plaster_air": (125, 5),
    "plaster_finish": (26, 2),
    "strand": (20, 0),
    "trail": (25, 0),
    "glow_shrink": (10, 4),
    "glow_blur": (20, 7),
    "light_air": (85, 4),
    "light_finish": (22, 2),
    "ink": (45, 1),
    "stroke": (45, 2),
    "paper": (75, 2),
    "ink_finish": (40, 3),
    "cloud": (10, 0),
    "veil": (40, 0),
}
_VERTEX = {
    "screen": (8, 0),
    "air": (20, 0),
    "body": (130, 5),
    "cast": (110, 5),
    "strand": (170, 5),
    "trail": (200, 6),
    "cloud": (230, 14),
}


@dataclass(frozen=True)
class Use:
    """One draw call."""

    vertex: str
    fragment: str
    vertices: int
    triangles: int
    pixels: float

    @property
    def seconds(self) -> float:
        """On a Raspberry Pi 4, reckoned: operations or fetches, whichever is more, and memory."""
        operations, fetches = _FRAGMENT[self.fragment]
        vertex_operations, vertex_fetches = _VERTEX[self.vertex]
        shaded, placed = self.pixels, self.vertices * _VERTEX_PASSES
        return (
            max(
                (shaded * operations + placed * vertex_operations) / _OPERATIONS_S,
                (shaded * fetches + placed * vertex_fetches) / _FETCHES_S,
            )
            + shaded * _BYTES_A_PIXEL / _BYTES_S
            + _DRAW_CALL_S
        )


@dataclass(frozen=True)
class Figures:
    """What one picture takes.

    overdraw: pixels shaded by all passes, for each pixel of the picture; gpu_bytes: textures and buffers, the
    caller's target included; pi4_ms: milliseconds on a Raspberry Pi 4, reckoned, not measured.
    """

    draw_calls: int
    triangles: int
    vertices: int
    overdraw: float
    gpu_bytes: int
    pi4_ms: float


class Tally:
    """The draw calls of one picture."""

    def __init__(self) -> None:
        self._uses: list[Use] = []

    def clear(self) -> None:
        """A new picture begins."""
        self._uses.clear()

    def put_down(self, use: Use) -> None:
        """Count a draw call."""
        self._uses.append(use)

    def figures(self, picture_pixels: int, gpu_bytes: int) -> Figures:
        """Sum it up for a picture of so many pixels."""
        return Figures(
            draw_calls=len(self._uses),
            triangles=sum(use.triangles for use in self._uses),
            vertices=sum(use.vertices for use in self._uses),
            overdraw=sum(use.pixels for use in self._uses) / max(picture_pixels, 1),
            gpu_bytes=gpu_bytes,
            pi4_ms=1000 * sum(use.seconds for use in self._uses),
        )
