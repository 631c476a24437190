"""Moment: where the dancer is at the time for which one picture is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
TRAIL_S = 1.2  # what a look may show of the past


@dataclass(slots=True)
class Moment:
    """The input of a look; J joints in the skeleton's order, world frame, Y up, metres.

    time_s: the dance's time of this picture, monotonic seconds (at least a tick behind the clock);
    positions: (J, 3); world: (J, 4) unit quaternions w, x, y, z, both interpolated to time_s;
    trail: (positions, world) at the ticks of the last TRAIL_S up to time_s, newest last, never empty;
    trail_times: when each of these was, seconds, same clock as time_s, ascending, none later than time_s;
    holds: (J,) how firmly a hand holds each joint at time_s, 0..1; None: no hand holds any;
    others: the same moment of the puppets beside the first.

    Drawing code reads the arrays and keeps none.
    """

    time_s: float
    positions: Floats
    world: Floats
    trail: Sequence[tuple[Floats, Floats]]
    trail_times: Sequence[float]
    holds: Floats | None = None
    others: tuple[Moment, ...] = ()
