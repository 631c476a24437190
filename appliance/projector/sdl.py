"""SDL2 without what its Python package says on the terminal about where the library comes from."""

from __future__ import annotations

import warnings

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import sdl2

__all__ = ["sdl2"]
