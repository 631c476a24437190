"""Held positions: puppeteers that give a joint a position instead of an orientation (fixed, OSC)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appliance.dancer.puppeteers import Puppeteer
from appliance.dancer.reach import Reach
from appliance.dancer.slerp import FloatArray
from appliance.dancer.two_bones import add, scale
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.pose.turns import minus
from appliance.show.hand import FARTHEST_M

REACH = 0.95  # share of the stretched chain of bones: at its very end every way on turns the whole body
HIPS_REACH_M = 1.0  # offset of the hips from their own path

Point = tuple[float, float, float]
_ORIGIN: Point = (0.0, 0.0, 0.0)


class Limits(NamedTuple):
    """How a position follows what it is told: speed, acceleration, and the lag behind a steady hand."""

    m_s: float
    m_s2: float
    follow_s: float


LIMBS = Limits(3.0, 60.0, 0.05)  # the hands of the recorded dancers reach 3 to 4 m/s
HIPS = Limits(1.0, 5.0, 0.2)  # the feet have to come along


def in_figure(positions: Array, root: Array, facing: Array) -> Array:
    """Places (..., 3) of the room in the frame of the figure, metres.

    root (3,): of the figure in the room; facing (4,): its heading, a turn about +Y. In the figure's frame the
    root joint is the origin and faces +Z, as the network sees it.
    """
    return quaternion.rotate(quaternion.inverse(facing), positions - root)


def in_room(positions: Array, root: Array, facing: Array) -> Array:
    """The inverse of in_figure."""
    return quaternion.rotate(facing, positions) + root


def reach_of(skeleton: Skeleton, joint: int) -> float:
    """How far a joint gets from the root, metres: REACH of all bones from there, stretched.

    The root itself: HIPS_REACH_M, from its own path.
    """
    chain = skeleton.ancestors(joint)[:-1]
    if not chain:
        return HIPS_REACH_M
    return REACH * float(sum(np.linalg.norm(skeleton.offsets[one]) for one in chain))


class HeldPosition(Puppeteer):
    """Holds one joint at a position. Its weight grows and fades as that of every hand.

    The position starts where the joint is when the hand takes it, and follows what it is told within Limits:
    one that jumps moves the figure no faster than a dancer does. It stays above the floor and within
    `reach` of the root. habitual: where this dancer's joint goes at all, if known.
    """

    SNAPSHOT: tuple[str, ...] = ("_place", "_speed", "_given")

    habitual: Reach | None = None

    def __init__(self, joint: str, skeleton: Skeleton, weight: float = 1.0) -> None:
        super().__init__(joint, weight)
        self.number = skeleton.index(joint)
        self.reach = reach_of(skeleton, self.number)
        self._given: Point | None = None
        self._here = self._aim = self._root = _ORIGIN
        self._place = self._speed = _ORIGIN
        self._limits = HIPS if self.is_root else LIMBS

    @property
    def is_root(self) -> bool:
        """Whether it holds the hips: their position moves the whole figure."""
        return self.number == 0

    @property
    def given(self) -> Point | None:
        """The position given last, metres in the room; None: none."""
        return self._given

    def stand(self, here: Sequence[float], root: Sequence[float], given: Point | None) -> None:
        """Before each pull: where its joint is and where the root will be, metres, and `given` as the same
        frame has it.
        """
        self._here, self._root = _three(here), _three(root)
        self._aim = self._place if given is None else given

    def position(self, ahead_s: float = 0.0) -> Point:
        """Where the last pull held the joint, or will hold it ahead_s later; in the frame of `stand`."""
        x, y, z = (at + ahead_s * speed for at, speed in zip(self._place, self._speed, strict=True))
        return self._bounded((x, y, z))

    def _holds(self, now: float) -> bool:
        return self._given is not None

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        """Move the position towards what it was told; the orientation stays."""
        if not self.is_holding:
            self._place, self._speed = self._here, _ORIGIN
        if not elapsed:
            return
        limits = self._limits
        way = minus(self._bounded(self._aim), self._place)
        far = math.hypot(*way)
        wanted = scale(way, min(1.0 / max(limits.follow_s, elapsed), limits.m_s / far)) if far > 0.0 else way
        change = minus(wanted, self._speed)
        most = limits.m_s2 * elapsed
        length = math.hypot(*change)
        if length > most:
            change = scale(change, most / length)
        self._speed = add(self._speed, change)
        self._place = add(self._place, scale(self._speed, elapsed))

    def _bounded(self, position: Point) -> Point:
        """Above the floor, and within reach of the root."""
        x, y, z = position
        way = minus((x, max(0.0, y), z), self._root)
        far = math.hypot(*way)
        return add(self._root, scale(way, min(1.0, self.reach / far))) if far > 0.0 else self._root


class FixedPosition(HeldPosition):
    """Holds its joint at one position for good."""

    def __init__(
        self, joint: str, skeleton: Skeleton, position: Sequence[float], weight: float = 1.0
    ) -> None:
        """position: x, y, z in the room, metres. Raises ValueError."""
        super().__init__(joint, skeleton, weight)
        self._given = checked_position(position)


class RemotePosition(HeldPosition):
    """A joint whose position remote control gives (OSC, a finger on the page, a tracker); free until then."""

    SNAPSHOT = ("_left_s",)

    def __init__(self, joint: str, skeleton: Skeleton, weight: float = 1.0) -> None:
        super().__init__(joint, skeleton, weight)
        self._left_s = math.inf

    def hold(self, position: Sequence[float], for_s: float = math.inf) -> None:
        """Hold the joint at x, y, z in the room, metres; let go where for_s pass without a new position.

        Raises ValueError.
        """
        self._given, self._left_s = checked_position(position), for_s

    def hold_here(self, position: Sequence[float]) -> None:
        """Hold the joint where it is, unless a position was set before."""
        if self._given is None:
            self.hold(position)

    def let_go(self) -> None:
        """Give the joint back to the puppet."""
        self._given = None

    def _point(self, orientation: FloatArray, now: float, elapsed: float) -> None:
        self._left_s -= elapsed
        if self._left_s < 0.0:
            self._given, self._aim = None, self._place
        super()._point(orientation, now, elapsed)


def checked_position(position: Sequence[float]) -> Point:
    """Three finite numbers, metres. Raises ValueError."""
    numbers = [float(value) for value in position]
    if len(numbers) != 3 or not all(abs(value) <= FARTHEST_M for value in numbers):
        raise ValueError(
            f"{numbers} is no position: three numbers in metres are needed, at most {FARTHEST_M:g} each."
        )
    return _three(numbers)


def _three(values: Sequence[float]) -> Point:
    x, y, z = values
    return float(x), float(y), float(z)
