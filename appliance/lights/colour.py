"""Colour: red, green and blue for lamps that add white, or mix cyan, magenta and yellow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.show.fixture_profile import base

# The share of a colour that a channel shows; 'red of rgbw' is what the white lamp leaves to the red one.
COMPONENTS = (
    *("red", "green", "blue"),
    *("red of rgbw", "green of rgbw", "blue of rgbw", "white"),
    *("cyan", "magenta", "yellow"),
)
SUBTRACTIVE = tuple(COMPONENTS.index(word) for word in ("cyan", "magenta", "yellow"))


def mixed(rgb: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """All components of a colour (red, green, blue as shares 0..1), in the order of COMPONENTS."""
    red, green, blue = (float(part) for part in rgb)
    white = min(red, green, blue)
    additive = (red, green, blue, red - white, green - white, blue - white, white)
    return np.array((*additive, 1.0 - red, 1.0 - green, 1.0 - blue))


def components_of(attributes: Sequence[str]) -> dict[str, int]:
    """Index in COMPONENTS of each attribute that shows colour; a white lamp takes the white part."""
    bases = {base(name) for name in attributes}
    found = {}
    for name in attributes:
        word = base(name)
        if word in ("red", "green", "blue") and "white" in bases:
            word += " of rgbw"
        if word in COMPONENTS:
            found[name] = COMPONENTS.index(word)
    return found


def between(colours: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """The colour at a share 0..1 through colours (N, 3)."""
    at = share * (len(colours) - 1)
    first = min(int(at), len(colours) - 1)
    second = min(first + 1, len(colours) - 1)
    part = at - first
    straight: NDArray[np.float64] = (1.0 - part) * colours[first] + part * colours[second]
    return straight
