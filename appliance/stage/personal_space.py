"""Personal space: puppets do not dance through each other; they are led apart before they meet."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from appliance.box.clock import TICK_S
from appliance.dancer.lead import shortened
from appliance.stage.stage_puppet import StagePuppet

MARGIN_M = 0.25  # they begin to give way so far outside their space
AHEAD_S = 0.4  # how far their ways are looked ahead
GIVES_WAY = 4.0  # metres a second, together, for each metre that they would be too near
_SPEED_S = 0.2  # time constant of their measured speeds
_NO_WAY_M = 0.02  # nearer than this, which way is apart is not theirs to say
_FASTEST_M_S = 3.0  # a root that jumps farther was put there


class PersonalSpace:
    """Leads puppets that are near each other apart, once a tick before they stand.

    The roots (hips) are kept apart on the floor, by the sum of both puppets' `space`.
    """

    SNAPSHOT = ("_places", "_speeds")

    def __init__(self, puppets: Sequence[StagePuppet], spaces: Sequence[float]) -> None:
        """spaces: metres around each puppet; 0: it goes through others."""
        self._puppets = tuple(puppets)
        self._pairs = [
            (one, other, spaces[one] + spaces[other])
            for one, other in itertools.combinations(range(len(puppets)), 2)
            if spaces[one] and spaces[other]
        ]
        self._places: list[tuple[float, float]] = []
        self._speeds = [(0.0, 0.0)] * len(puppets)

    def keep(self) -> None:
        """From the puppets' places in the last tick."""
        places = []
        for one in self._puppets:
            x, _, z = one.frame.root.tolist()
            places.append((x, z))
        if self._places:
            follow = TICK_S / _SPEED_S
            for number, ((x, z), (from_x, from_z)) in enumerate(zip(places, self._places, strict=True)):
                dx, dz = shortened((x - from_x) / TICK_S, (z - from_z) / TICK_S, _FASTEST_M_S)
                was_x, was_z = self._speeds[number]
                self._speeds[number] = was_x + follow * (dx - was_x), was_z + follow * (dz - was_z)
        self._places = places
        for first, second, space_m in self._pairs:
            self._part(first, second, space_m + MARGIN_M)

    def _part(self, one: int, other: int, apart_m: float) -> None:
        """Lead two of them apart, as far as they are, or will be, nearer than that."""
        x, z = (b - a for a, b in zip(self._places[one], self._places[other], strict=True))
        sx, sz = (b - a for a, b in zip(self._speeds[one], self._speeds[other], strict=True))
        now_m = math.hypot(x, z)
        closing = min(0.0, (x * sx + z * sz) / max(now_m, _NO_WAY_M))
        missing_m = apart_m - max(0.0, now_m + AHEAD_S * closing)
        if missing_m <= 0.0:
            return
        if now_m < _NO_WAY_M:
            x, z, now_m = 1.0, 0.0, 1.0
        speed = 0.5 * GIVES_WAY * missing_m / now_m
        self._puppets[one].lead_on_stage(-speed * x, -speed * z)
        self._puppets[other].lead_on_stage(speed * x, speed * z)
