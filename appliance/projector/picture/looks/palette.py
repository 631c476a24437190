"""Palette: the colours of each style, where the show does not say its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appliance.pose.quaternion import Array
from appliance.show.look import LookConfig

_OWN = {  # figure, light, accent, background, held
    "plaster": ("#f3ede4", "#ffe4c4", "#86b2f2", "#6f675f", "#ff6a3c"),
    "lines": ("#ffd7a1", "#fff4e0", "#3d7bff", "#10141f", "#ff3b1f"),
    "ink": ("#14110f", "#2a2320", "#8c2f1f", "#e9dfcb", "#d8401c"),
    "cloud": ("#cfe0ff", "#ffe3c2", "#3b63d8", "#0d1220", "#ff7a2e"),
    "strings": ("#86a6d0", "#ffdca8", "#4a74c0", "#0b0f18", "#ff5a2a"),
    "veil": ("#bfe6e0", "#ffffff", "#c04a7a", "#0c1016", "#ff7a2e"),
}


@dataclass(frozen=True)
class Palette:
    """Linear light, red, green, blue from 0 to 1."""

    figure: Array
    light: Array
    accent: Array
    background: Array
    held: Array


def palette(look: LookConfig) -> Palette:
    """A look's colours, its style's own where it says none."""
    chosen = (look.figure, look.light, look.accent, look.background, look.held.colour)
    return Palette(*(linear(own or given) for own, given in zip(chosen, _OWN[look.style], strict=True)))


def linear(colour: str) -> Array:
    """'#rrggbb' as linear light."""
    return np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]) ** 2


def stored(light: Array) -> Array:
    """Light as a canvas of eight bits keeps it where lights are added: as its root, with room above white."""
    return 0.5 * np.sqrt(light)
