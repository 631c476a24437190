"""Moment: where the dancer is at the time for which one picture is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
TRAIL_S = 1.2  # what a look may show of the past


@dataclass(slots=True)
class PuppetMoment:
    """A puppet at the time of a picture; J joints in the skeleton's order, world frame, Y up, metres.

    positions: (J, 3); world: (J, 4) unit quaternions w, x, y, z; trail: (positions, world) at each of the
    moment's trail_times; holds: (J,) how firmly a hand holds each joint, 0..1; None: no hand holds any.
    """

    positions: Floats
    world: Floats
    trail: Sequence[tuple[Floats, Floats]]
    holds: Floats | None = None


@dataclass(slots=True)
class Moment:
    """The input of a look: all puppets, interpolated to one time.

    time_s: the dance's time of this picture: ticks of 20 ms since its first one, so that each box that dances
    it has its camera, haze and dust in the same place;
    trail_times: the ticks of the last TRAIL_S, seconds, same clock, ascending, none later than time_s, never
    empty.

    Drawing code reads the arrays and keeps none.
    """

    time_s: float
    trail_times: Sequence[float]
    puppets: tuple[PuppetMoment, ...]
