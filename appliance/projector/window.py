"""The window: a whole display without a desktop (KMS/DRM), a window on one, or none at all (offscreen)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, Literal

from appliance.projector.keyboards import Key, Keyboards
from appliance.projector.projector_error import NO_DISPLAY, ProjectorError
from appliance.projector.sdl import sdl2
from appliance.show.projector import ProjectorConfig

Size = tuple[int, int]
Kind = Literal["fullscreen", "window", "offscreen"]
_WITHOUT_DESKTOP = "kmsdrm"
_TITLE = b"Bunraku"
_BLACK = "The audience sees no picture; the dance goes on."
_SHIFT = sdl2.KMOD_LSHIFT | sdl2.KMOD_RSHIFT


class Window:
    """One window with an OpenGL ES surface. Raises ProjectorError where there is no display to be had."""

    def __init__(self, config: ProjectorConfig, kind: Kind, size: Size | None = None) -> None:
        """`size`: in place of the box file's, pixels."""
        self.kind = kind
        self.driver = _start(kind)
        try:
            display = 0 if kind == "offscreen" else _find_display(config.display)
            self.handle = _create(kind, display, size or config.size)
            self.display_rate = _rate(display)
        except BaseException:
            sdl2.SDL_QuitSubSystem(sdl2.SDL_INIT_VIDEO)
            raise
        self.keyboards = Keyboards() if self.driver == _WITHOUT_DESKTOP else None
        sdl2.SDL_ShowCursor(sdl2.SDL_DISABLE)
        sdl2.SDL_DisableScreenSaver()

    @property
    def size(self) -> Size:
        """The size to draw, pixels; on a dense display more than the window's nominal size."""
        width, height = sdl2.c_int(), sdl2.c_int()
        sdl2.SDL_GL_GetDrawableSize(self.handle, width, height)
        return max(1, width.value), max(1, height.value)

    def show(self) -> None:
        """Make the picture visible; waits for the display if that sets the pace."""
        sdl2.SDL_GL_SwapWindow(self.handle)

    def set_pace(self, vsync: bool) -> bool:
        """Ask to wait for the display at each `show`; whether the driver promises it."""
        return sdl2.SDL_GL_SetSwapInterval(int(vsync)) == 0 and vsync and self.kind != "offscreen"

    def events(self) -> Iterator[Key | None]:
        """Keys that were pressed since the last time; None: the window was closed."""
        event = sdl2.SDL_Event()
        while sdl2.SDL_PollEvent(event):
            if event.type == sdl2.SDL_QUIT:
                yield None
            elif event.type == sdl2.SDL_KEYDOWN and self.keyboards is None:
                key = event.key.keysym
                yield Key(sdl2.SDL_GetKeyName(key.sym).decode(errors="replace"), bool(key.mod & _SHIFT))
        if self.keyboards is not None:
            yield from self.keyboards.pressed()

    def toggle_fullscreen(self) -> None:
        """From the window onto the whole display and back."""
        if self.kind == "offscreen":
            return
        self.kind = "window" if self.kind == "fullscreen" else "fullscreen"
        whole = sdl2.SDL_WINDOW_FULLSCREEN_DESKTOP if self.kind == "fullscreen" else 0
        sdl2.SDL_SetWindowFullscreen(self.handle, whole)

    def close(self) -> None:
        if self.keyboards is not None:
            self.keyboards.close()
        sdl2.SDL_DestroyWindow(self.handle)
        sdl2.SDL_QuitSubSystem(sdl2.SDL_INIT_VIDEO)


def last_error() -> str:
    """SDL's last error."""
    return sdl2.SDL_GetError().decode(errors="replace") or "no reason given"


def _start(kind: Kind) -> str:
    """Start SDL on the first display system that is there; its name."""
    sdl2.SDL_SetHint(sdl2.SDL_HINT_NO_SIGNAL_HANDLERS, b"1")
    sdl2.SDL_SetHint(b"SDL_VIDEO_X11_FORCE_EGL", b"1")  # with GLX many drivers have no OpenGL ES
    # KMS/DRM would take a picture and return while the one before waits for the display: one frame older.
    sdl2.SDL_SetHint(sdl2.SDL_HINT_VIDEO_DOUBLE_BUFFER, b"1")
    complaints = []
    for driver in _drivers(kind):
        sdl2.SDL_SetHintWithPriority(sdl2.SDL_HINT_VIDEODRIVER, driver.encode(), sdl2.SDL_HINT_OVERRIDE)
        if sdl2.SDL_InitSubSystem(sdl2.SDL_INIT_VIDEO) == 0:
            return driver
        complaints.append(f"{driver}: {last_error()}")
    raise ProjectorError(
        f"There is no display ({'; '.join(complaints)}). {_BLACK} "
        "Plug the projector in and switch it on before the box, and let this user use the graphics card "
        "(groups video and render); on a desktop start this command from the desktop.",
        NO_DISPLAY,
    )


def _drivers(kind: Kind) -> list[str]:
    """The display systems to try: SDL itself would also accept one that shows nothing."""
    if kind == "offscreen":
        return ["offscreen"]
    chosen = os.environ.get("SDL_VIDEODRIVER")
    if chosen:
        return chosen.split(",")
    found = [
        driver for driver, at in (("wayland", "WAYLAND_DISPLAY"), ("x11", "DISPLAY")) if os.environ.get(at)
    ]
    return [*found, _WITHOUT_DESKTOP]


def _find_display(wanted: int | str) -> int:
    count = sdl2.SDL_GetNumVideoDisplays()
    names = [(sdl2.SDL_GetDisplayName(place) or b"").decode(errors="replace") for place in range(count)]
    if isinstance(wanted, int):
        if 0 <= wanted < count:
            return wanted
    else:
        for place, name in enumerate(names):
            if wanted.casefold() in name.casefold():
                return place
    there = ", ".join(f"{place} ({name})" for place, name in enumerate(names)) or "none"
    raise ProjectorError(
        f"There is no display {wanted!r}; these are there: {there}. {_BLACK} "
        "Plug it in, or name another one under `display` in the projector's part of the box file.",
        NO_DISPLAY,
    )


def _create(kind: Kind, display: int, size: Size) -> Any:
    for attribute, value in (
        (sdl2.SDL_GL_CONTEXT_PROFILE_MASK, sdl2.SDL_GL_CONTEXT_PROFILE_ES),
        (sdl2.SDL_GL_CONTEXT_MAJOR_VERSION, 3),
        (sdl2.SDL_GL_CONTEXT_MINOR_VERSION, 0),
        (sdl2.SDL_GL_DOUBLEBUFFER, 1),
        (sdl2.SDL_GL_DEPTH_SIZE, 0),  # scenes are drawn into textures with their own depth
    ):
        sdl2.SDL_GL_SetAttribute(attribute, value)
    flags = sdl2.SDL_WINDOW_OPENGL | sdl2.SDL_WINDOW_SHOWN | sdl2.SDL_WINDOW_ALLOW_HIGHDPI
    if kind == "fullscreen":
        flags |= sdl2.SDL_WINDOW_FULLSCREEN_DESKTOP
    elif kind == "window":
        flags |= sdl2.SDL_WINDOW_RESIZABLE
    place = sdl2.SDL_WINDOWPOS_CENTERED_MASK | display
    handle = sdl2.SDL_CreateWindow(_TITLE, place, place, *size, flags)
    if not handle:
        raise ProjectorError(
            f"The display takes no window with OpenGL ES 3.0 ({last_error()}). {_BLACK} "
            "Install the graphics card's driver (on Debian: libgl1-mesa-dri, libegl1, libgles2, libgbm1).",
            NO_DISPLAY,
        )
    return handle


def _rate(display: int) -> float | None:
    """The display's pictures a second; None if it does not report them."""
    mode = sdl2.SDL_DisplayMode()
    if sdl2.SDL_GetCurrentDisplayMode(display, mode) != 0 or mode.refresh_rate <= 0:
        return None
    return float(mode.refresh_rate)
