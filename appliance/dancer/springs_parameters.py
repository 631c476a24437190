"""The springs' present parameters: a setting's numbers and the knobs on top, gliding from one to the next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.glide import Glide
from appliance.show.springs import Region, SpringsConfig

REGIONS: tuple[Region, ...] = get_args(Region)
STORM = np.array([9.0, 1.0, 4.0])  # m/s at full strength
STORM_AIR = 2.0  # 1/s
_PARTS = {
    "regions": slice(0, 16),  # mass, stiffness, directional stiffness, damping of each
    "air_and_hand": slice(16, 20),  # follow, gusts, air, stir
    "wind": slice(20, 23),
    "gravity": slice(23, 24),
    "feedback": slice(24, 25),
    "stiffness": slice(25, 26),  # a factor
    "storm": slice(26, 27),
    "gate": slice(27, 28),  # whether feedback may act
}
KNOBS = ("wind", "gravity", "feedback", "stiffness", "storm", "gate")


class SpringsParameters:
    """mass, stiffness, directional, damping (N,) of each node; the rest are of all.

    wind (3,), gravity: as they were set; blow (3,): the wind with the storm.
    """

    SNAPSHOT = ("_glide",)

    def __init__(self, regions: Sequence[tuple[Region, Region]]) -> None:
        """regions: of each node's mass, and of the bone that leads to it."""
        self._own = np.array([REGIONS.index(own) for own, _ in regions])
        self._turning = np.array([REGIONS.index(turning) for _, turning in regions])
        self._glide = Glide(28, roots=16)
        self.mass, self.stiffness, self.directional, self.damping = np.zeros((4, len(self._own)))
        self.blow = np.zeros(3)
        self.follow, self.stir, self.gusts, self.air, self.feedback = np.zeros(5).tolist()
        self.turn("gate", (1.0,), 0.0)

    @property
    def wind(self) -> NDArray[np.float64]:
        """(3,) m/s, without the storm."""
        return self._glide.values[_PARTS["wind"]]

    @property
    def gravity(self) -> float:
        """m/s^2."""
        return float(self._glide.values[_PARTS["gravity"]][0])

    def call(self, setting: SpringsConfig, seconds: float) -> None:
        """Go over to a setting; the knobs return to where they turn nothing."""
        regions = [setting.region(name) for name in REGIONS]
        numbers = [(one.mass, one.stiffness, one.directional_stiffness, one.damping) for one in regions]
        values: dict[str, Any] = {
            "regions": np.ravel(numbers),
            "air_and_hand": (setting.follow, setting.gusts, setting.air, setting.stir),
            "wind": setting.wind,
            "gravity": setting.gravity,
            "feedback": setting.feedback,
            "stiffness": 1.0,
            "storm": 0.0,
        }
        for name, numbers_of in values.items():
            self._glide.aim(_PARTS[name], numbers_of, seconds)
        self.settle()

    def turn(self, knob: str, values: Sequence[float], seconds: float) -> None:
        """Turn one of KNOBS."""
        self._glide.aim(_PARTS[knob], values, seconds)
        self.settle()

    def step(self) -> bool:
        """One tick; whether anything has changed."""
        changed = self._glide.step()
        if changed:
            self.settle()
        return changed

    def settle(self) -> None:
        """Work out what follows from the values."""
        values = self._glide.values
        regions = values[_PARTS["regions"]].reshape(len(REGIONS), 4)
        self.follow, gusts, air, self.stir = values[_PARTS["air_and_hand"]].tolist()
        feedback, factor, storm, gate = values[24:].tolist()
        self.mass, self.damping = regions[self._own, 0], regions[self._own, 3]
        self.stiffness = regions[self._turning, 1]
        self.directional = regions[self._turning, 2] * factor
        self.gusts, self.air = max(gusts, storm), max(air, storm * STORM_AIR)
        self.blow = self.wind + storm * STORM
        self.feedback = feedback * gate
