"""The nearest recorded pose: how far a dance is from the recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import Take
from appliance.studio.studio_error import StudioError

STRAINED_DEGREES = 10.0  # from every orientation that the joint ever had: no longer how this dancer moves
HOLDS_DEGREES = 15.0  # a recorded joint this close to the hand's orientation counts as held by it
CANDIDATES = 128
PIECE = 1024  # poses converted at once
ROWS = 128  # ticks searched at once: their scores against 35,000 poses are 18 MB

Floats = NDArray[np.float32]
Rows = NDArray[Any]


class Reference:
    """The recorded poses (N, M, 4) of a dancer, heading removed, and the search for the nearest of them.

    Nearest is the smallest mean joint angle. One matrix product of rotation matrices ranks all poses by the
    sum of sin^2(angle / 2); the mean angle is then computed for the CANDIDATES best. Compared with the
    exhaustive search (120 ticks of salsa_29, 34,424 poses), every tick gave the same result in a fortieth of
    the time.
    """

    def __init__(self, poses: Array, largest_step: float = float("nan")) -> None:
        """largest_step: the furthest that a joint goes from tick to tick in the recordings, degrees."""
        self.largest_step = largest_step
        self.poses = piecewise(without_heading, poses)
        self._features = piecewise(columns_of, self.poses)

    def __len__(self) -> int:
        return len(self.poses)

    def nearest(
        self,
        poses: Array,
        joints: Sequence[int] | None = None,
        held: int | None = None,
        hand: Array | None = None,
    ) -> Floats:
        """(T,): degrees of mean joint angle from poses (T, M, 4) to the nearest pose of the reference.

        joints: those compared, all if not given. held, hand (T, 4): only among poses whose joint `held` lies
        within HOLDS_DEGREES of the hand's orientation; not a number where there is none.
        """
        level = without_heading(poses).astype(np.float32)
        compared = np.arange(level.shape[1]) if joints is None else np.asarray(joints)
        parts = []
        for first in range(0, len(level), ROWS):
            rows = slice(first, first + ROWS)
            allowed = None if held is None or hand is None else self._holding(held, hand[rows])
            parts.append(self._nearest(level[rows], compared, allowed))
        return np.concatenate(parts) if parts else np.zeros(0, dtype=np.float32)

    def strained(self, poses: Array, joints: Sequence[int] | None = None) -> float:
        """Share of poses (T, M, 4) in which a joint is beyond what it ever did, by STRAINED_DEGREES.

        A limit of swing and twist that is learned joint by joint. joints: those looked at, all if not given;
        a root may have any orientation.
        """
        level = without_heading(poses).astype(np.float32)
        near = np.ones(len(level), dtype=np.bool_)
        cosine = np.cos(np.radians(STRAINED_DEGREES / 2))
        looked_at = range(level.shape[1]) if joints is None else joints
        for joint in (joint for joint in looked_at if joint):
            known = self.poses[:, joint].T
            for first in range(0, len(level), ROWS):
                rows = slice(first, first + ROWS)
                near[rows] &= np.abs(level[rows, joint] @ known).max(axis=1) >= cosine
        return float(1.0 - near.mean())

    def holding_nearest(self, held: int, hand: Array) -> Floats:
        """(T, M, 4): at each tick the recorded pose whose joint `held` is nearest to the hand's (T, 4)."""
        turns = hand.astype(np.float32)
        found = [
            np.abs(turns[first : first + ROWS] @ self.poses[:, held].T).argmax(axis=1)
            for first in range(0, len(turns), ROWS)
        ]
        chosen: Floats = self.poses[np.concatenate(found)]
        return chosen

    def _holding(self, held: int, hand: Array) -> NDArray[np.bool_]:
        """(T, N): whether a pose of the reference holds the joint as the hand does at each tick."""
        cosines = np.abs(hand.astype(np.float32) @ self.poses[:, held].T)
        return np.asarray(cosines >= np.cos(np.radians(HOLDS_DEGREES / 2)))

    def _nearest(
        self, poses: Floats, compared: NDArray[np.intp], allowed: NDArray[np.bool_] | None
    ) -> Floats:
        chosen = np.zeros_like(poses)
        chosen[:, compared] = poses[:, compared]
        scores = columns_of(chosen) @ self._features.T
        if allowed is not None:
            scores[~allowed] = -np.inf
        count = min(CANDIDATES, len(self))
        best = np.argpartition(scores, len(self) - count, axis=1)[:, -count:]
        near = self.poses[best][:, :, compared]
        cosines = np.abs(np.einsum("tjk,tcjk->tcj", poses[:, compared], near))
        degrees = np.degrees(2 * np.arccos(np.minimum(cosines, 1.0))).mean(axis=-1)
        degrees[np.take_along_axis(scores, best, axis=1) == -np.inf] = np.inf
        found = degrees.min(axis=1)
        return np.where(np.isfinite(found), found, np.nan).astype(np.float32)


def reference_of(takes: Sequence[Take], joints: Sequence[str]) -> Reference:
    """The sound poses of takes, joints by name. Raises StudioError where there is none."""
    places = [takes[0].recording.skeleton.index(name) for name in joints]
    steps = [_largest_step(take, places) for take in takes]
    poses = np.concatenate([take.recording.poses[take.sound][:, places] for take in takes])
    if not len(poses):
        raise StudioError(
            "No sound pose is left in the recordings that the dance is compared with. Give the folder of the "
            "training takes."
        )
    return Reference(poses, max(steps))


def without_heading(poses: Array) -> Array:
    """Poses (..., M, 4), the root first, turned to face ahead."""
    facing = quaternion.heading(poses[..., :1, :])
    root = quaternion.multiply(quaternion.inverse(facing), poses[..., :1, :])
    return np.concatenate([root, poses[..., 1:, :]], axis=-2)


def _largest_step(take: Take, places: Sequence[int]) -> float:
    """The largest joint angle between successive sound poses, degrees."""
    level = without_heading(take.recording.poses[:, places])
    steps = np.degrees(quaternion.angle_between(level[1:], level[:-1])).max(axis=-1)
    return float(steps[take.sound[1:] & take.sound[:-1]].max(initial=0.0))


def columns_of(poses: Array) -> Floats:
    """(N, 9 M): rotation matrices, whose distance is sqrt(8) sin(angle / 2) for each joint.

    Zero quaternions, for joints that are left out, give zeros.
    """
    columns: Floats = quaternion.to_matrix(poses).reshape(len(poses), -1).astype(np.float32)
    return columns


def piecewise(make: Callable[[Rows], Rows], rows: Rows) -> Floats:
    """Converts rows (N, ...) to float32, a few at a time: the steps to it take ten times as much memory."""
    first = make(rows[:PIECE])
    found = np.empty((len(rows), *first.shape[1:]), dtype=np.float32)
    found[:PIECE] = first
    for begin in range(PIECE, len(rows), PIECE):
        found[begin : begin + PIECE] = make(rows[begin : begin + PIECE])
    return found
