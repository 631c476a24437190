"""Targets: the textures that a picture passes through on its way, shared by all looks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import moderngl

from appliance.projector.picture.image_file import MOST_WIDE
from appliance.projector.sdl import sdl2

_FRAMEBUFFER, _DEPTH = 0x8D40, 0x8D00  # GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT


class Target:
    """A texture of four bytes a pixel that can be drawn into, optionally with depth."""

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], depth: bool = False, samples: int = 0
    ) -> None:
        """samples: of each pixel's edges, melted into the texture by `finish`; 0: one, in its middle."""
        self.size, self._ctx, self.samples = size, ctx, samples
        self.texture = ctx.texture(size, 4)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._depth = ctx.depth_renderbuffer(size, samples=samples) if depth else None
        self._fine = ctx.renderbuffer(size, 4, samples=samples) if samples else None
        self._melted = ctx.framebuffer([self.texture]) if samples else None
        self.buffer = ctx.framebuffer([self._fine or self.texture], self._depth)
        self._invalidate = _invalidation() if depth else None

    def use(self) -> None:
        """Draw here again, over what is there."""
        self.buffer.use()
        self.buffer.viewport = (0, 0, *self.size)

    def start(self, colour: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Draw here from now on, over one colour."""
        self.use()
        self.buffer.clear(*colour)

    def keep(self, channels: str, depth: bool = True) -> None:
        """Restrict drawing to these channels ('r' to 'a'), and depth only if wanted."""
        self.buffer.color_mask = ("r" in channels, "g" in channels, "b" in channels, "a" in channels)
        self.buffer.depth_mask = depth
        self.buffer.use()

    def finish(self) -> None:
        """All is drawn. Depth is discarded: a GPU that draws in tiles then never stores it."""
        if self._invalidate is not None:
            self._invalidate(_FRAMEBUFFER, 1, ctypes.byref(ctypes.c_uint(_DEPTH)))
        if self._melted is not None:
            self._ctx.copy_framebuffer(self._melted, self.buffer)

    def release(self) -> None:
        self.buffer.release()
        self.texture.release()
        for owned in (self._depth, self._fine, self._melted):
            if owned is not None:
                owned.release()


def of_lines(lines: int, aspect: float) -> tuple[int, int]:
    """The size of a soft picture of that many lines, of fewer where it would be too wide for a texture."""
    lines = max(1, min(lines, int(MOST_WIDE / aspect)))
    return max(2, round(lines * aspect)), lines


def _invalidation() -> Callable[..., None]:
    """OpenGL's glInvalidateFramebuffer, which the library does not offer."""
    address = sdl2.SDL_GL_GetProcAddress(b"glInvalidateFramebuffer")
    return ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)(address)
