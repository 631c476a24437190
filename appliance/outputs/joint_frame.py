"""Joint frame: the one message for every output, made once and filled in every tick; also how it is read."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


@dataclass(slots=True)
class PuppetFrame:
    """One puppet in a joint frame, J joints in the skeleton's order.

    Write into the arrays (`puppet.pose[:] = ...`); outputs read them while they publish and keep nothing.
    """

    SNAPSHOT = ("pose", "world", "positions", "root")

    root: Floats  # (3,) world, metres
    pose: Floats  # (J, 4) w, x, y, z local to the parent joint
    source: Floats  # (J, 4) local: what the puppet starts from, the phrase
    world: Floats  # (J, 4) w, x, y, z
    positions: Floats  # (J, 3) world, metres
    holds: Floats  # (J,) 0..1: how firmly a hand holds each joint now

    @classmethod
    def of(cls, joints: int) -> PuppetFrame:
        """At rest at the origin, free."""
        rest = np.zeros((joints, 4), np.float32)
        rest[:, 0] = 1.0
        root, positions, holds = (np.zeros(shape, np.float32) for shape in (3, (joints, 3), joints))
        return cls(root, rest, rest.copy(), rest.copy(), positions, holds)


@dataclass(slots=True)
class JointFrame:
    """The poses of all puppets at one tick, in the show's order. One that was read has read-only arrays.

    hands (H, 4): where the hands of all puppets point their joints, w, x, y, z, whether they hold them or
    not; zeros: a hand that gives no single orientation. live (J, 3): joints of the live dancer, metres, where
    the stream has them; zeros: nobody is there. (0, 3) in a show that takes none.
    """

    SNAPSHOT = ("sensor_sequence", "sensor_arrival")
    TIMES = ("sensor_arrival",)

    puppets: tuple[PuppetFrame, ...]
    tick: int = 0
    frame_time: float = 0.0  # seconds on the monotonic clock
    late: bool = False  # the last pose again, because the tick was not done in time
    sensor_sequence: int = -1  # the primary sensor's newest reading in this frame; -1 without one
    sensor_arrival: float = 0.0  # when that reading came in, seconds on the monotonic clock
    left: float = 0.0  # when it left the stage, the same clock; for readers of the shared frame
    hands: Floats = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    live: Floats = field(default_factory=lambda: np.zeros((0, 3), np.float32))
