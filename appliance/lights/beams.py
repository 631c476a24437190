"""Beams: where the light of each fixture goes, in which colour, how bright and how wide."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appliance.lights.head import Array, own_axes
from appliance.lights.patch import Patch, Values
from appliance.show.fixture_profile import COLOURS, DIMMER
from appliance.show.lights import FixtureConfig

# Profiles do not say how wide a beam is: usual angles of heads with a zoom, of heads without, of other lamps.
ZOOM_DEGREES, HEAD_DEGREES, LAMP_DEGREES = (8.0, 45.0), 20.0, 40.0
_TINTS = {
    "red": (1, 0, 0),
    "green": (0, 1, 0),
    "blue": (0, 0, 1),
    "white": (1, 1, 1),
    "amber": (1, 0.6, 0.1),
    "uv": (0.4, 0.1, 0.9),
    "lime": (0.7, 1, 0.2),
    "indigo": (0.3, 0.2, 1),
    "warm white": (1, 0.8, 0.6),
    "cold white": (0.85, 0.92, 1),
}
_SPOT_ONLY = {"gobo", "iris", "focus", "prism"}  # attributes of lamps with a hard edge
SPOT, WASH, LAMP = "moving spot", "moving wash", "lamp"
_FILTERS = ("cyan", "magenta", "yellow")  # each takes red, green or blue away


class Beam(NamedTuple):
    """place: metres; direction: a unit vector; colour: red, green, blue, the brightest of them 1; level:
    0 dark to 1 full; degrees: from edge to edge; kind: SPOT, WASH (both move) or LAMP."""

    fixture: FixtureConfig
    place: Array
    direction: Array
    colour: Array
    level: float
    degrees: float
    kind: str


def beams_of(patch: Patch, values: Values) -> list[Beam]:
    """The beams of a rig at these values (S,), heads as they point now, all others along their own axis."""
    found, heads = [], patch.heads
    directions = dict(enumerate(heads.beams()))
    for fixture in patch.fixtures:
        colour, level, degrees = _light(patch, values, fixture)
        own = [place for place, head in enumerate(heads.heads) if head.fixture is fixture]
        ways = [directions[place] for place in own] or [own_axes(fixture)[1]]
        width = degrees or (HEAD_DEGREES if own else LAMP_DEGREES)
        place = np.array(fixture.place, float)
        kind = _head_kind(patch, fixture) if own else LAMP
        found += [Beam(fixture, place, way, colour, level, width, kind) for way in ways]
    return found


def _head_kind(patch: Patch, fixture: FixtureConfig) -> str:
    return SPOT if _SPOT_ONLY & {patch.slots[place].base for place in patch.own(fixture)} else WASH


def _light(patch: Patch, values: Values, fixture: FixtureConfig) -> tuple[Array, float, float]:
    """Colour and level of a fixture, and its zoom in degrees; 0: it has none. Cells count by their mean."""
    shares: dict[str, list[float]] = {}
    for place in patch.own(fixture):
        slot = patch.slots[place]
        if slot.channels or slot.base != DIMMER:
            shares.setdefault(slot.base, []).append(float(values[place]))
    mean = {name: sum(several) / len(several) for name, several in shares.items()}
    lamps = [mean[name] * np.array(tint) for name, tint in _TINTS.items() if name in mean]
    light = np.minimum(np.sum(lamps, axis=0), 1.0) if lamps else np.ones(3)
    light = light * [1.0 - mean.get(name, 0.0) for name in _FILTERS]
    brightest, zoom = float(light.max()), mean.get("zoom")
    colour = light / brightest if brightest > 0.0 else np.ones(3)
    low, high = ZOOM_DEGREES
    is_lamp = DIMMER in mean or bool(mean.keys() & {*COLOURS, *_TINTS})
    level = brightest * mean.get(DIMMER, 1.0) if is_lamp else 0.0
    return colour, level, 0.0 if zoom is None else low + zoom * (high - low)
