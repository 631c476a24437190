"""ALSA, through which Linux reaches sound cards, and PortAudio on top of it: whether they can be started."""

from __future__ import annotations

import contextlib
import ctypes
from typing import Any

_ALSA = "libasound.so.2"


def has_sound() -> bool:
    """Whether PortAudio may start: where ALSA's configuration names no devices it aborts."""
    try:
        alsa = ctypes.CDLL(_ALSA)
    except OSError:
        return True  # another system's sound; without any PortAudio says so itself
    alsa.snd_config_search.argtypes = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
    alsa.snd_config_update_free_global()  # it remembers what it once read
    with contextlib.suppress(ValueError):
        return alsa.snd_config_update() < 0 or (
            bool(top := ctypes.c_void_p.in_dll(alsa, "snd_config").value)
            and alsa.snd_config_search(top, b"pcm", None) == 0
        )
    return True


def start_anew(library: Any) -> None:
    """Start PortAudio (`sounddevice`) once more: it lists the cards when it starts. Raises its own errors."""
    with contextlib.suppress(Exception):  # it did not start at the last try
        library._terminate()
    library._initialize()
