"""Joint frame: the one message for every output, made once and filled in every tick."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(slots=True)
class JointFrame:
    """The dancer's pose at one tick, J joints in the skeleton's order.

    Write into the arrays (`frame.pose[:] = ...`); outputs read them while they publish and keep nothing.
    """

    SNAPSHOT = ("pose", "world", "positions", "root", "sensor_sequence", "sensor_arrival")

    joints: int
    tick: int = 0
    frame_time: float = 0.0  # seconds on the monotonic clock
    late: bool = False  # the last pose again, because the tick was not done in time
    sensor_sequence: int = -1  # the primary sensor's newest reading in this frame; -1 without one
    sensor_arrival: float = 0.0  # when that reading came in, seconds on the monotonic clock
    pose: NDArray[np.float32] = field(init=False)  # (J, 4) w, x, y, z local to the parent joint
    source: NDArray[np.float32] = field(init=False)  # (J, 4) local: what the puppet starts from, the phrase
    world: NDArray[np.float32] = field(init=False)  # (J, 4) w, x, y, z
    positions: NDArray[np.float32] = field(init=False)  # (J, 3) world, metres
    root: NDArray[np.float32] = field(init=False)  # (3,) world, metres
    holds: NDArray[np.float32] = field(init=False)  # (J,) 0..1: how firmly a hand holds each joint now

    def __post_init__(self) -> None:
        self.pose = np.zeros((self.joints, 4), np.float32)
        self.pose[:, 0] = 1.0
        self.source, self.world = self.pose.copy(), self.pose.copy()
        self.positions = np.zeros((self.joints, 3), np.float32)
        self.root = np.zeros(3, np.float32)
        self.holds = np.zeros(self.joints, np.float32)
