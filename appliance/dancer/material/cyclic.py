"""Cyclic motion: a loop as windows that go round and round, and windows blended back into one cycle.

Motion decoded from such windows joins its own start: nothing has to be bent there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.loop import Loop, Placement, turns_about_y
from appliance.dancer.material.motion_network import Poses
from appliance.pose import quaternion
from appliance.pose.quaternion import Array

Starts = NDArray[np.int64]
OVERLAP = 4  # windows that know a pose
# A network that is uncertain about a rotation gives a short quaternion, and windows that contradict each
# other leave a short mean: below this length the rotation is taken from the poses around it, or it spins.
UNCERTAIN = 0.35


@dataclass(frozen=True)
class Cycle:
    """A loop as it goes on for ever: poses (P, J, 4) without sign jumps, track (P + 1, C), and the step on
    the stage from one round to the next; start_s: where in the phrase it begins.
    """

    poses: Poses
    track: Poses
    step: Placement
    start_s: float

    @staticmethod
    def of(loop: Loop) -> Cycle:
        """Without the frames that only the first round has."""
        own = slice(loop.fade, loop.length)
        poses = quaternion.continuous(loop.poses[own]).astype(np.float32, copy=False)
        return Cycle(poses, loop.track[loop.fade : loop.length + 1], loop.step, loop.start_s + loop.fade / 50)

    def windows(self, starts: Starts, length: int, places: list[int]) -> Poses:
        """Windows (W, length, M, 4) of the joints at these places, the root first; also across the end."""
        at = starts[:, None] + np.arange(length)
        found = self.poses[at % len(self.poses)][:, :, places]
        found[:, :, 0] = quaternion.multiply(self._turns(at), found[:, :, 0])
        return quaternion.continuous(found, axis=1).astype(np.float32, copy=False)

    def blended(self, parts: Iterable[tuple[Poses, Starts]], places: list[int]) -> Poses:
        """Windows (W, T, M, 4) at these starts, part after part, longer quaternions being more certain -> the
        cycle's poses (P, J, 4); other joints stay.
        """
        mean = HannMean(len(self.poses), len(places))
        for windows, starts in parts:
            at = starts[:, None] + np.arange(windows.shape[1])
            back = windows.copy()
            back[:, :, 0] = quaternion.multiply(quaternion.inverse(self._turns(at)), windows[:, :, 0])
            back = quaternion.continuous(back, axis=1)  # a network turns back where it cannot know a heading
            middle = windows.shape[1] // 2
            own = self.poses[at[:, middle] % len(self.poses)][:, places]
            against = np.sum(back[:, middle] * own, axis=-1) < 0
            mean.add(np.where(against[:, None, :, None], -back, back), starts)
        moved, made = mean.poses(), self.poses.copy()
        made[:, places] = moved
        return quaternion.continuous(made).astype(np.float32, copy=False)

    def loop(self, poses: Poses, lifts: Array | None, rest_heights: Array | None, number: int) -> Loop:
        """A closed loop of other poses (P, J, 4) on the same way; lifts (P,), rest_heights (S,): floor."""
        from appliance.dancer.phrase import LIFT, NUMBER, STANDING

        last = poses[:1].copy()
        last[:, 0] = quaternion.multiply(turns_about_y(np.array([self.step.yaw])), last[:, 0])
        last = quaternion.aligned(last, poses[-1:])
        track = self.track.copy()
        track[:, NUMBER] = number
        if lifts is not None and rest_heights is not None:
            track[:, LIFT] = np.append(lifts, lifts[0])
            track[:, STANDING:NUMBER] = rest_heights
        whole = np.concatenate([poses, last]).astype(np.float32, copy=False)
        return Loop.made(whole, track, self.step, self.start_s)

    def _turns(self, at: Starts) -> Array:
        """How far the dancer has turned by itself in the rounds before these frames."""
        return turns_about_y(self.step.yaw * (at // len(self.poses))).astype(np.float32)


def even_starts(period: int, window: int) -> Starts:
    """Where windows of a cycle begin, so that OVERLAP of them know each pose."""
    count = min(period, math.ceil(period * OVERLAP / window))
    return np.floor(np.arange(count) * period / count).astype(int)


def hann_mean(windows: Poses, starts: Starts, period: int) -> Poses:
    """Windows (W, T, M, 4) at these starts of a cycle, their signs alike, weighted by their lengths -> its
    poses (period, M, 4).
    """
    mean = HannMean(period, windows.shape[2])
    mean.add(windows, starts)
    return mean.poses()


class HannMean:
    """The poses of a cycle (period, joints, 4): the mean of windows that are added in parts."""

    def __init__(self, period: int, joints: int) -> None:
        self._total, self._sums = np.zeros((period, joints, 4)), np.zeros(period)

    def add(self, windows: Poses, starts: Starts) -> None:
        """Take in windows (W, T, M, 4) at these starts, their signs alike, weighted by their lengths."""
        length, period = windows.shape[1], len(self._sums)
        weights = np.hanning(length + 2)[1:-1] if length > 1 else np.ones(1)
        for window, start in zip(windows, starts, strict=True):
            at = (start + np.arange(length)) % period
            np.add.at(self._total, at, weights[:, None, None] * window)
            np.add.at(self._sums, at, weights)

    def poses(self) -> Poses:
        """(period, M, 4), once all windows have come; it is empty afterwards."""
        made, self._total = self._total, np.zeros((0, 0, 4))
        made /= self._sums[:, None, None]
        lengths = np.sqrt(np.einsum("pjk,pjk->pj", made, made))
        made /= np.maximum(lengths, 1e-9)[..., None]
        for joint in np.flatnonzero((lengths < UNCERTAIN).any(axis=0)):
            made[:, joint] = bridged(made[:, joint], lengths[:, joint] < UNCERTAIN)
        result: Poses = made.astype(np.float32)
        return result


def bridged(rotations: Array, uncertain: Array) -> Array:
    """Rotations (P, 4) of a cycle; uncertain ones (P,) lead from the certain one before to the next."""
    certain = np.flatnonzero(np.logical_not(uncertain))
    if not len(certain):
        return np.broadcast_to(rotations[:1], rotations.shape).copy()
    whole, period = rotations.copy(), len(rotations)
    for frame in np.flatnonzero(uncertain):
        place = int(np.searchsorted(certain, frame))
        before = certain[place - 1] - (period if place == 0 else 0)
        after = certain[place % len(certain)] + (period if place == len(certain) else 0)
        share = np.array((frame - before) / (after - before))
        whole[frame] = quaternion.slerp(rotations[before % period], rotations[after % period], share)
    return whole
