"""How far a map of poses leads: how much the figure changes from one of its corners to the opposite one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array

DEAD = 0.5  # fraction of the usual difference between two poses; less counts as no movement
COMPARED = 500  # poses


@dataclass(frozen=True)
class MapReach:
    """Mean joint angles in degrees, headings left out: between opposite corners of the map, and usually
    between two poses of the dancer.
    """

    corners: float
    usual: float

    @staticmethod
    def of(low: Array, high: Array, poses_at: Callable[[Array], Array], danced: Array) -> MapReach:
        """Bounds of a map from low to high (2,); poses_at: points (N, 2) -> poses (N, M, 4); danced (T, M,
        4).
        """
        corners = np.array([low, high, (low[0], high[1]), (high[0], low[1])])
        one, other, third, fourth = quaternion.normalize(poses_at(corners).astype(np.float64))
        some = danced[:: max(1, len(danced) // COMPARED)]
        usual = _apart(some, np.roll(some, len(some) // 2, axis=0)).mean()
        return MapReach(float(max(_apart(one, other), _apart(third, fourth))), float(usual))

    @property
    def is_dead(self) -> bool:
        """Whether hardly anything changes when one moves over the map."""
        return not self.corners >= DEAD * self.usual

    def sentence(self) -> str:
        seen = (
            f"from corner to corner the figure changes by {self.corners:.0f} degrees a joint, two poses of "
            f"the dancer usually differ by {self.usual:.0f}"
        )
        if not self.is_dead:
            return f"The map is alive: {seen}."
        return (
            f"The map is dead: {seen}. Moving over it changes next to nothing, though the network has other "
            "directions that do. Train one that has only the map's: --latent 2, or 3."
        )


def _apart(one: Array, other: Array) -> Array:
    """Mean angle over the joints of poses (..., M, 4), the root's left out: it has the heading."""
    apart: Array = np.degrees(quaternion.angle_between(one, other))[..., 1:].mean(axis=-1)
    return apart
