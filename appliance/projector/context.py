"""The OpenGL ES 3.0 context of a window, and whether it is software or lost."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import moderngl

from appliance.projector.projector_error import NO_DISPLAY, ProjectorError
from appliance.projector.sdl import sdl2
from appliance.projector.window import Size, Window, last_error
from appliance.show.projector import ProjectorConfig

ES_3_0 = 300
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")
_RESET_STATUS = (b"glGetGraphicsResetStatus", b"glGetGraphicsResetStatusKHR", b"glGetGraphicsResetStatusEXT")


class GlContext:
    """A context that is current on this thread. Raises ProjectorError if there is no OpenGL ES 3.0."""

    def __init__(self, window: Window) -> None:
        self._handle = _create(window)
        try:
            loader: Any = _Loader()
            self.gl = moderngl.create_context(require=ES_3_0, context=loader)
        except Exception as error:  # the library raises whatever its driver does
            sdl2.SDL_GL_DeleteContext(self._handle)
            raise _unusable(str(error)) from error
        self.renderer = str(self.gl.info["GL_RENDERER"])
        self._reset_status = reset_status()
        self._finish = ctypes.CFUNCTYPE(None)(sdl2.SDL_GL_GetProcAddress(b"glFinish"))

    @property
    def is_software(self) -> bool:
        """Whether the processor draws, for lack of a graphics card or its driver."""
        return any(word in self.renderer.casefold() for word in _SOFTWARE)

    @property
    def is_lost(self) -> bool:
        """Whether the graphics card was reset: all that was on it is gone, for good."""
        return self._reset_status() != 0

    def finish(self) -> None:
        """Wait until all is drawn. Unlike moderngl's own, this lets other threads run meanwhile."""
        self._finish()

    def close(self) -> None:
        self.gl.release()
        sdl2.SDL_GL_DeleteContext(self._handle)


@contextmanager
def offscreen(size: Size) -> Iterator[moderngl.Context]:
    """A context on no display, for pictures into files: `with offscreen((1280, 720)) as gl`."""
    window = Window(ProjectorConfig(), "offscreen", size)
    try:
        context = GlContext(window)
        try:
            yield context.gl
        finally:
            context.close()
    finally:
        window.close()


class _Loader:
    """Gives moderngl SDL's functions: the only ones that are right on X11, Wayland and KMS/DRM alike."""

    def load_opengl_function(self, name: str) -> int:
        return sdl2.SDL_GL_GetProcAddress(name.encode()) or 0

    def __enter__(self) -> _Loader:
        return self

    def __exit__(self, *error: object) -> None:
        """SDL's context stays current."""

    def release(self) -> None:
        """SDL owns the context."""


def _create(window: Window) -> object:
    """A context that reports a reset of the graphics card, if the driver can."""
    for tells_resets in (1, 0):
        sdl2.SDL_GL_SetAttribute(sdl2.SDL_GL_CONTEXT_RESET_NOTIFICATION, tells_resets)
        sdl2.SDL_GL_SetAttribute(
            sdl2.SDL_GL_CONTEXT_FLAGS, tells_resets * sdl2.SDL_GL_CONTEXT_ROBUST_ACCESS_FLAG
        )
        handle = sdl2.SDL_GL_CreateContext(window.handle)
        if handle:
            return handle
    raise _unusable(last_error())


def _unusable(why: str) -> ProjectorError:
    return ProjectorError(
        f"The display has no OpenGL ES 3.0 ({why}). The audience sees no picture; the dance goes on. "
        "Install the graphics card's driver (on Debian: libgl1-mesa-dri, libegl1, libgles2, libgbm1).",
        NO_DISPLAY,
    )


def reset_status() -> Callable[[], int]:
    """OpenGL's own function, where the driver has it (GL_KHR_robustness)."""
    for name in _RESET_STATUS:
        address = sdl2.SDL_GL_GetProcAddress(name)
        if address:
            return ctypes.CFUNCTYPE(ctypes.c_uint)(address)
    return lambda: 0
