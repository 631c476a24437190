"""Moving heads: from a point on the stage to pan and tilt, without a flip and no faster than the head moves.

A standing head's own axes: y up from its base, z to its front, x to the left when looking along z. At pan 0
and tilt 0 its beam goes along y; tilt leans it towards z, pan turns it from z towards x. Each direction has
two solutions, tilt to either side with pan half a turn apart; each pan repeats after a whole turn, where the
range allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.lights.slot import Slot
from appliance.pose import quaternion
from appliance.show.fixture_profile import PAN, TILT
from appliance.show.lights import FixtureConfig

Array = NDArray[np.float64]

USUAL_DEGREES = {PAN: 540.0, TILT: 270.0}
USUAL_SLEW = 180.0  # degrees a second
TURNS = np.arange(-2.0, 3.0) * 360.0  # enough for ranges of two whole turns to either side
FLIP_GAIN = 5.0  # degrees of pan that the other solution must save before a head takes it
# A dancer who passes close below a head demands more pan speed than it has, or the other tilt. The solution
# is chosen by where pan will be in LOOK_AHEAD_S: at 1.5 m/s, 3 m below, the beam is at most 4.9 degrees off
# instead of 8.2. Closer to the head's own axis than QUIET_CONE pan barely moves the beam, so it moves slower.
LOOK_AHEAD_S, MOST_AHEAD, JUMP = 0.1, 90.0, 45.0  # degrees; a heading that jumps in one pass is no motion
QUIET_CONE = np.sin(np.radians(3.0))
LONGEST_STEP_S = 0.1  # after a pause heads continue from where they were, at their usual speed


@dataclass(frozen=True)
class Head:
    """One moving head: the slots of its pan and tilt."""

    fixture: FixtureConfig
    pan: int
    tilt: int


class Axes:
    """Pan and tilt slots (A): range, limits and slew in degrees. Angles count from the range's middle."""

    def __init__(self, places: Sequence[int], slots: Sequence[Slot]) -> None:
        own = [slots[place] for place in places]
        self.slots = np.array(places, np.intp)
        self.degrees = np.array([slot.config.degrees or USUAL_DEGREES[slot.base] for slot in own])
        limits = [_limits(slot, degrees) for slot, degrees in zip(own, self.degrees, strict=True)]
        self.low, self.high = np.array(limits, float).reshape(-1, 2).T
        self.slew = np.array([slot.config.slew or USUAL_SLEW for slot in own])

    def angles(self, values: Array) -> Array:
        """Degrees (A,) of slot values (S,), within the limits."""
        angles: Array = np.clip((values[self.slots] - 0.5) * self.degrees, self.low, self.high)
        return angles

    def shares(self, angles: Array) -> Array:
        """Slot values 0..1 (A,) of angles in degrees (A,)."""
        shares: Array = angles / self.degrees + 0.5
        return shares


class Heads:
    """The moving heads (H) of a rig and all its pan and tilt slots (A): `angles` (A,) is where they are."""

    def __init__(self, axes: Axes, heads: Sequence[Head]) -> None:
        self.axes, self.heads = axes, tuple(heads)
        places = {int(slot): place for place, slot in enumerate(axes.slots)}
        self.pans = np.array([places[head.pan] for head in heads], np.intp)
        self.tilts = np.array([places[head.tilt] for head in heads], np.intp)
        self.places = np.array([head.fixture.place for head in heads], float).reshape(-1, 3)
        self.local_from_world = np.array([own_axes(head.fixture) for head in heads]).reshape(-1, 3, 3)
        self.angles = np.clip(np.zeros(len(axes.slots)), axes.low, axes.high)
        self._tilt_signs = np.ones(len(heads))  # 1: tilt towards the front, -1: to the other side
        self._headings = np.zeros(len(heads))

    def follow(self, wanted: Array, aims: Array, aimed: NDArray[np.bool_], seconds: float) -> None:
        """Move towards angles `wanted` (A,), where `aimed` (H,) towards points `aims` (H, 3) in metres."""
        axes, wanted = self.axes, wanted.copy()
        reach = axes.slew * min(seconds, LONGEST_STEP_S)
        heading, polar, sideways = self._directions(aims)
        pan, sign = self._nearest(heading, polar, self._ahead(heading, seconds))
        pans, tilts = self.pans[aimed], self.tilts[aimed]
        self._tilt_signs[aimed] = sign[aimed]
        wanted[pans] = np.clip(pan[aimed], axes.low[pans], axes.high[pans])
        quiet = np.where(polar < 90.0, sideways / QUIET_CONE, 1.0)
        reach[pans] *= np.minimum(1.0, quiet[aimed])
        self._step(pans, wanted, reach)
        off = np.radians(heading[aimed] - self.angles[pans])
        wanted[tilts] = np.clip(polar[aimed] * np.cos(off), axes.low[tilts], axes.high[tilts])
        reach[pans] = 0.0  # they have moved already
        self._step(slice(None), wanted, reach)

    def beams(self) -> Array:
        """Directions of the beams on the stage, unit vectors (H, 3)."""
        pan, tilt = np.radians(self.angles[self.pans]), np.radians(self.angles[self.tilts])
        own = np.stack([np.sin(tilt) * np.sin(pan), np.cos(tilt), np.sin(tilt) * np.cos(pan)], axis=-1)
        world: Array = np.einsum("hji,hj->hi", self.local_from_world, own)
        return world

    def _step(self, which: NDArray[np.intp] | slice, wanted: Array, reach: Array) -> None:
        step = wanted[which] - self.angles[which]
        self.angles[which] += np.clip(step, -reach[which], reach[which])

    def _directions(self, aims: Array) -> tuple[Array, Array, Array]:
        """Heading from the front, angle from the head's axis, both in degrees; its sine; each (H,)."""
        own = np.einsum("hij,hj->hi", self.local_from_world, aims - self.places)
        aside = np.hypot(own[:, 0], own[:, 2])
        far = np.maximum(np.hypot(aside, own[:, 1]), 1e-9)
        heading = np.degrees(np.arctan2(own[:, 0], own[:, 2]))
        return heading, np.degrees(np.arctan2(aside, own[:, 1])), aside / far

    def _ahead(self, heading: Array, seconds: float) -> Array:
        """How far headings move within LOOK_AHEAD_S, degrees (H,)."""
        step = (heading - self._headings + 180.0) % 360.0 - 180.0
        self._headings = heading
        ahead = step * (LOOK_AHEAD_S / max(seconds, 1e-3))
        return np.where(np.abs(step) < JUMP, np.clip(ahead, -MOST_AHEAD, MOST_AHEAD), 0.0)

    def _nearest(self, heading: Array, polar: Array, ahead: Array) -> tuple[Array, Array]:
        """The nearest pan (H,) among all that point there, and the sign of its tilt (H,)."""
        axes, pans, tilts = self.axes, self.pans, self.tilts
        pan = np.concatenate([heading[:, None] + TURNS, heading[:, None] + 180.0 + TURNS], axis=1)
        sign = np.repeat([1.0, -1.0], len(TURNS))
        tilt = sign * polar[:, None]
        out = np.maximum(axes.low[pans][:, None] - pan, pan - axes.high[pans][:, None]).clip(0.0)
        out += np.maximum(axes.low[tilts][:, None] - tilt, tilt - axes.high[tilts][:, None]).clip(0.0)
        cost = np.abs(pan + (ahead - self.angles[pans])[:, None]) + FLIP_GAIN * (
            sign != self._tilt_signs[:, None]
        )
        best = np.argmin(cost + 1000.0 * out, axis=1)
        return pan[np.arange(len(best)), best], sign[best]


def own_axes(fixture: FixtureConfig) -> Array:
    """Rotation matrix (3, 3) from the stage's axes into the fixture's own."""
    yaw, pitch, roll = np.radians(fixture.turn)
    world_from_local = quaternion.from_euler(np.array([yaw, pitch, roll]), "yxz")
    if fixture.pose == "hanging":
        upside_down = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.pi)
        world_from_local = quaternion.multiply(world_from_local, upside_down)
    matrix: Array = quaternion.to_matrix(world_from_local).T.astype(float)
    return matrix


def heads_of(slots: Sequence[Slot]) -> Heads:
    """The heads of a rig: each pan with the tilt of the same fixture and number."""
    axes = [place for place, slot in enumerate(slots) if slot.base in (PAN, TILT)]
    tilts = {(slots[place].fixture.name, slots[place].name): place for place in axes}
    heads = []
    for place in axes:
        slot = slots[place]
        twin = (slot.fixture.name, slot.name.replace(PAN, TILT, 1))
        if slot.base == PAN and twin in tilts:
            heads.append(Head(slot.fixture, place, tilts[twin]))
    return Heads(Axes(axes, slots), heads)


def _limits(slot: Slot, degrees: float) -> tuple[float, float]:
    """Lowest and highest angle: the range, and within it what the patch allows."""
    allowed = slot.fixture.pan_limits if slot.base == PAN else slot.fixture.tilt_limits
    low, high = allowed or (-degrees / 2, degrees / 2)
    return max(low, -degrees / 2), min(high, degrees / 2)
