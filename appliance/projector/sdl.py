"""SDL2, without its Python package's message about the library's origin on the terminal."""

from __future__ import annotations

import warnings

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import sdl2

__all__ = ["sdl2"]
