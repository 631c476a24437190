"""Lead: a figure's root is led over the floor, to a goal or out of another's way, without a jolt."""

from __future__ import annotations

import math

from appliance.box.clock import TICK_S

FASTEST_M_S = 0.8
QUICKEST_M_S2 = 2.0


class Lead:
    """Adds up what is asked for in a tick, and follows it: x, z in metres a second on the figure's floor."""

    SNAPSHOT = ("_speed",)

    def __init__(self) -> None:
        self._asked, self._speed = (0.0, 0.0), (0.0, 0.0)

    def ask(self, x: float, z: float) -> None:
        """In this tick; what several ask for adds up."""
        self._asked = self._asked[0] + x, self._asked[1] + z

    def step(self) -> tuple[float, float]:
        """Once a tick: how far the root is led in it, metres."""
        x, z = shortened(*self._asked, FASTEST_M_S)
        change = shortened(x - self._speed[0], z - self._speed[1], QUICKEST_M_S2 * TICK_S)
        self._speed = self._speed[0] + change[0], self._speed[1] + change[1]
        self._asked = 0.0, 0.0
        return self._speed[0] * TICK_S, self._speed[1] * TICK_S


def shortened(x: float, z: float, most: float) -> tuple[float, float]:
    """A vector that is no longer than that."""
    length = math.hypot(x, z)
    return (x, z) if length <= most else (x / length * most, z / length * most)
