"""Tally: what a picture costs, counted, and its time on a Raspberry Pi 4, estimated."""

from __future__ import annotations

from dataclasses import dataclass

# A Raspberry Pi 4's GPU, the VideoCore VI, has 8 units of 4 lanes with a multiplication and an addition a
# cycle at 500 MHz: 32 thousand million operations a second at most. What shaders get is taken from glmark2
# on a Raspberry Pi 5 (12 units, 960 MHz): effect2d with 25 samples a pixel, 10 operations each, takes 2.2 ms
# more at 800x600 than an empty picture. For the units and the clock of the 4 that makes 14 thousand million
# operations and 1.4 thousand million samples a second. Published scores of glmark2 as a whole are 290 and 425
# for the 4, 880 for the 5: 2.1 to 3 times, where units and clock say 2.9. Memory: units that do nothing but
# read got 7.2 GB/s (py-videocore6's summation); 5 leaves room for writing, the display and the processor.
# All in all within a factor of 1.5: no rate was measured with these shaders.
_OPERATIONS_S, _FETCHES_S, _BYTES_S = 14e9, 1.4e9, 5e9
_DRAW_CALL_S = 30e-6  # of the driver, state and uniforms included
_VERTEX_PASSES = 2  # the GPU goes over vertices twice: for where they are, and to draw them

# Operations and texture fetches of each fragment shader for a pixel and of each vertex shader for a vertex,
# counted by hand in their main paths; a power counts as 8.
_FRAGMENT = {
    "depth": (8, 0),
    "cast": (12, 0),
    "cast_blur": (90, 13),
    "plaster": (230, 10),
    "plaster_air": (125, 5),
    "plaster_finish": (75, 6),
    "plaster_finish FRAME": (14, 1),
    "plaster_finish GAMMA": (99, 6),
    "plaster_finish GAMMA FRAME": (38, 1),
    "strand": (20, 0),
    "trail": (25, 0),
    "glow_shrink": (10, 4),
    "glow_blur": (20, 7),
    "light_air": (130, 6),
    "light_finish": (22, 2),
    "light_finish GAMMA": (46, 2),
    "ink": (45, 1),
    "stroke": (45, 2),
    "paper": (75, 2),
    "ink_finish": (70, 4),
    "ink_finish FRAME": (20, 1),
    "ink_finish GAMMA": (94, 4),
    "ink_finish GAMMA FRAME": (44, 1),
    "cloud": (10, 0),
    "veil": (40, 0),
    "card": (60, 2),
    "card GAMMA": (84, 2),
    "mask": (8, 1),
    "final": (6, 1),
    "final DIM": (26, 1),
    "final GAMMA DIM": (50, 1),
    "final BLEND DIM": (48, 1),
    "final GAMMA BLEND DIM": (72, 1),
    "final DIM MARKS": (130, 2),
    "final GAMMA DIM MARKS": (154, 2),
    "final BLEND DIM MARKS": (152, 2),
    "final GAMMA BLEND DIM MARKS": (176, 2),
}
BACKDROP = "BACKDROP"  # the part of a look's last step that has an image behind the figure
_IMAGE = (10, 1)  # what that adds
_VERTEX = {
    "screen": (8, 0),
    "laid": (20, 0),
    "final": (20, 0),
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
        """On a Raspberry Pi 4, estimated, without its memory: operations or fetches, whichever is more."""
        operations, fetches = _FRAGMENT[self.fragment.replace(f" {BACKDROP}", "")]
        if BACKDROP in self.fragment:
            operations, fetches = operations + _IMAGE[0], fetches + _IMAGE[1]
        vertex_operations, vertex_fetches = _VERTEX[self.vertex]
        shaded, placed = self.pixels, self.vertices * _VERTEX_PASSES
        return (
            max(
                (shaded * operations + placed * vertex_operations) / _OPERATIONS_S,
                (shaded * fetches + placed * vertex_fetches) / _FETCHES_S,
            )
            + _DRAW_CALL_S
        )


@dataclass(frozen=True)
class Cost:
    """The cost of one picture.

    overdraw: pixels shaded by all passes, for each pixel of the picture; moved_bytes: textures read and
    targets written; gpu_bytes: textures and buffers, a texture that is drawn onto included, a display not;
    pi4_ms: milliseconds of a Raspberry Pi 4's GPU, estimated, not measured.
    """

    draw_calls: int
    triangles: int
    vertices: int
    overdraw: float
    moved_bytes: float
    gpu_bytes: int
    pi4_ms: float


class Tally:
    """The draw calls of one picture, and what they move through memory.

    Each texture is read from memory once a draw call: its neighbours' samples come from a cache. A target is
    written once: a GPU that draws in tiles keeps depth and blending to itself.
    """

    def __init__(self) -> None:
        self._uses: list[Use] = []
        self._moved_bytes = 0.0

    def clear(self) -> None:
        """Start with a new picture."""
        self._uses.clear()
        self._moved_bytes = 0.0

    def count_bytes(self, count: float) -> None:
        """Count bytes read from memory or written to it."""
        self._moved_bytes += count

    def count_draw_call(self, use: Use) -> None:
        """Count one draw call."""
        self._uses.append(use)

    def cost(self, picture_pixels: int, gpu_bytes: int) -> Cost:
        """The sums, for a picture of `picture_pixels` pixels."""
        return Cost(
            draw_calls=len(self._uses),
            triangles=sum(use.triangles for use in self._uses),
            vertices=sum(use.vertices for use in self._uses),
            overdraw=sum(use.pixels for use in self._uses) / max(picture_pixels, 1),
            moved_bytes=self._moved_bytes,
            gpu_bytes=gpu_bytes,
            pi4_ms=1000 * (sum(use.seconds for use in self._uses) + self._moved_bytes / _BYTES_S),
        )
