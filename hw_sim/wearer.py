"""The wearer of an emulated sensor: stands still while the box takes the neutral pose, then dances."""

from __future__ import annotations

from appliance.pose.ease import ease
from hw_sim.motions import IDENTITY, Motion, Quaternion, inverse, multiply, part_of

EASE_S = 1.0  # from the rest pose into the motion
TAPS_AT_READING = 5  # a few of the first ones may be lost; the box counts taps from the first that it hears


class Wearer:
    """A hand that moves; its orientation is in stage axes.

    Stands in the rest pose for `stand_still_s` after the first reading left (infinite: until `start_moving`),
    then eases into the motion. With 0 it follows the motion from the start. One that taps asks with a double
    tap for the neutral pose, which the box then takes sooner.
    """

    def __init__(self, motion: Motion, stand_still_s: float = 0.0, taps: bool = False) -> None:
        self._motion = motion
        self._taps, self._readings = taps, 0
        self._stand_still_s = stand_still_s
        self._begun: float | None = None  # when the motion begins, seconds of the emulator's clock
        self._way_back = inverse(motion(0.0))

    def start(self, now: float) -> None:
        """The sensor is switched on for the first time."""
        if not self._stand_still_s and self._begun is None:
            self._begun = now

    def reading_sent(self, at: float) -> bool:
        """Called for each reading that leaves for the box; the first one starts the clock.

        Whether the sensor is tapped twice now.
        """
        if self._begun is None:
            self._begun = at + self._stand_still_s
        self._readings += 1
        return self._taps and self._readings == TAPS_AT_READING

    def start_moving(self, now: float) -> None:
        """Dance from now on."""
        self._begun = now

    def orientation(self, at: float) -> Quaternion:
        """How the hand stands."""
        if self._begun is None or at < self._begun:
            return IDENTITY if self._stand_still_s else self._motion(0.0)
        elapsed_s = at - self._begun
        orientation = self._motion(elapsed_s)
        if not self._stand_still_s or elapsed_s >= EASE_S:
            return orientation
        share = elapsed_s / EASE_S
        return multiply(orientation, part_of(self._way_back, 1.0 - ease(share)))
