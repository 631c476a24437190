"""Targets: the textures that a picture passes through on its way, shared by all looks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import moderngl

from appliance.projector.picture.tally import Tally
from appliance.projector.sdl import sdl2

_FRAMEBUFFER, _DEPTH = 0x8D40, 0x8D00  # GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT


class Target:
    """A texture of four bytes a pixel that can be drawn into, optionally with depth."""

    def __init__(
        self, ctx: moderngl.Context, tally: Tally, size: tuple[int, int], depth: bool = False
    ) -> None:
        self.size, self._tally = size, tally
        self.texture = ctx.texture(size, 4)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._depth = ctx.depth_renderbuffer(size) if depth else None
        self.buffer = ctx.framebuffer([self.texture], self._depth)
        self.bytes = size[0] * size[1] * (8 if depth else 4)
        self._invalidate = _invalidation() if depth else None

    @property
    def pixels(self) -> int:
        """How many it has."""
        return self.size[0] * self.size[1]

    def start(self, colour: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Draw here from now on, over one colour."""
        self.buffer.use()
        self.buffer.viewport = (0, 0, *self.size)
        self.buffer.clear(*colour)
        self._tally.count_bytes(4 * self.pixels)

    def keep(self, channels: str, depth: bool = True) -> None:
        """Restrict drawing to these channels ('r' to 'a'), and depth only if wanted."""
        self.buffer.color_mask = ("r" in channels, "g" in channels, "b" in channels, "a" in channels)
        self.buffer.depth_mask = depth
        self.buffer.use()

    def forget_depth(self) -> None:
        """Discard depth right after its last use: a GPU that draws in tiles then never stores it."""
        if self._invalidate is not None:
            self._invalidate(_FRAMEBUFFER, 1, ctypes.byref(ctypes.c_uint(_DEPTH)))

    def release(self) -> None:
        self.buffer.release()
        self.texture.release()
        if self._depth:
            self._depth.release()


def _invalidation() -> Callable[..., None]:
    """OpenGL's glInvalidateFramebuffer, which the library does not offer."""
    address = sdl2.SDL_GL_GetProcAddress(b"glInvalidateFramebuffer")
    return ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)(address)
