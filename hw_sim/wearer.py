"""Who wears an emulated sensor: stands still until the box had time for the neutral pose, then dances."""

from __future__ import annotations

from hw_sim.motions import IDENTITY, Motion, Quaternion, inverse, multiply, part_of

EASE_S = 1.0  # from standing into the motion


class Wearer:
    """A hand that moves; its orientation is in stage axes.

    Stands as in the rest pose until the sensor has been heard for `stand_still_s` (infinite: until it is told
    to `begin`), and then goes over into the motion. With 0 it follows the motion from the start and does not
    wait to be heard.
    """

    def __init__(self, motion: Motion, stand_still_s: float = 0.0) -> None:
        self._motion = motion
        self._stand_still_s = stand_still_s
        self._begun: float | None = None  # when the motion begins, seconds of the emulator's clock
        self._way_back = inverse(motion(0.0))

    def start(self, now: float) -> None:
        """The sensor is switched on for the first time."""
        if not self._stand_still_s and self._begun is None:
            self._begun = now

    def heard(self, at: float) -> None:
        """A reading leaves for the box: only the first one counts."""
        if self._begun is None:
            self._begun = at + self._stand_still_s

    def begin(self, now: float) -> None:
        """Whoever stands dances from now on."""
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
        return multiply(orientation, part_of(self._way_back, 1.0 - share * share * (3.0 - 2.0 * share)))
