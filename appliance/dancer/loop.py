"""Loop: an excerpt of a phrase made endless by crossfading its end into its start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from appliance.dancer.slerp import FloatArray, Slerp
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array

# A loop whose path misses its own start by less than this share of the way that it went is closed: the miss
# is spread over the whole way, where steps hide it. A longer miss is a walk, and is carried on.
CLOSING_SHARE = 0.25
CLOSING_M = 0.02
CLOSING_RADIANS = math.radians(2.0)
# The end leads into the start when no joint makes a step that is longer than this many of its neighbours.
CLOSED_STEP = 1.5
CLOSED_RADIANS = math.radians(0.5)
CLOSED_M = 0.003
_TURN_M = 0.3  # a radian of turning counts as much as this way when a miss is spread


@dataclass(frozen=True)
class Placement:
    """A phrase's place on the stage: turned by yaw about +Y, then moved by x, z (metres)."""

    yaw: float = 0.0
    x: float = 0.0
    z: float = 0.0

    def point(self, x: Any, z: Any) -> tuple[Any, Any]:
        """A point (or arrays of points) of the phrase's floor on the stage's floor."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return cosine * x + sine * z + self.x, cosine * z - sine * x + self.z

    def after(self, first: Placement) -> Placement:
        """The composition: `first`, then this one."""
        return Placement(self.yaw + first.yaw, *self.point(first.x, first.z))

    @property
    def inverse(self) -> Placement:
        x, z = Placement(-self.yaw).point(-self.x, -self.z)
        return Placement(-self.yaw, x, z)

    @staticmethod
    def bringing(old: tuple[float, float, float], new: tuple[float, float, float]) -> Placement:
        """The placement that maps old (x, z, yaw) to new."""
        yaw = new[2] - old[2]
        x, z = Placement(yaw).point(old[0], old[1])
        return Placement(yaw, new[0] - x, new[1] - z)


class Loop:
    """Frames 0..length-1 are the excerpt; the last `fade` frames are crossfaded into the first ones.

    An excerpt that is a closed loop already, its end leading into its start, is left as it is (`fade` 0).
    After frame length - 1 the motion goes on at frame `fade`, placed by `step` (where the excerpt's end
    stands from its start; nothing for a closed loop). Frame `length` is frame `fade` seen from the end.
    poses (length + 1, J, 4) float32; track (length + 1, C) float32: the root's position in metres, then
    columns that are only carried along; start_s: where in the phrase the excerpt begins. turns_home: entered
    at another heading, it turns back to its own, which faces the audience.
    """

    turns_home = False

    def __init__(self, poses: FloatArray, track: FloatArray, fade: int, start_s: float = 0.0) -> None:
        """poses (N, J, 4) without sign jumps, track (N, C); they are copied."""
        self.length = len(poses)
        closed = is_closed(poses, track[:, :3])
        self.fade = 0 if closed else min(fade, self.length // 2)
        self.period = self.length - self.fade
        self.start_s = start_s
        self.poses = np.concatenate([poses, poses[:1]])
        self.track = np.concatenate([track, track[:1]])
        self.step = Placement() if closed else self._close_or_carry()
        self._fade_over()

    @classmethod
    def made(cls, poses: FloatArray, track: FloatArray, step: Placement, start_s: float) -> Loop:
        """A closed loop as it is: poses (N + 1, J, 4) and track (N + 1, C), not copied; the last frame is the
        first one again, placed by the step.
        """
        loop = object.__new__(cls)
        loop.length = loop.period = len(poses) - 1
        loop.fade, loop.start_s, loop.step = 0, start_s, step
        loop.poses, loop.track = poses, track
        return loop

    def _close_or_carry(self) -> Placement:
        """Close the root's path if little is missing; returns the step that remains from end to start."""
        first = self.fade // 2
        last = min(self.period + first, self.length - 1)
        ground = self.track[first : last + 1, [0, 2]].astype(np.float64)
        yaw = np.unwrap(yaws(self.poses[first : last + 1, 0].astype(np.float64)))
        miss = math.dist(ground[0], ground[-1])
        miss_yaw = math.remainder(yaw[-1] - yaw[0], math.tau)
        way = np.hypot(*np.diff(ground, axis=0).T)
        turning = np.abs(np.diff(yaw))
        if (
            miss > CLOSING_SHARE * way.sum() + CLOSING_M
            or abs(miss_yaw) > CLOSING_SHARE * turning.sum() + CLOSING_RADIANS
        ):
            return Placement.bringing((*ground[0], yaw[0]), (*ground[-1], yaw[-1]))
        effort = np.concatenate([[0.0], np.cumsum(way + _TURN_M * turning + 1e-9)])
        share = np.ones(self.length)
        share[:first] = 0.0
        share[first : last + 1] = effort / effort[-1]
        self._close(first, last, share, miss_yaw)
        return Placement()

    def _close(self, first: int, last: int, share: Array, miss_yaw: float) -> None:
        """Remove the gap between two frames from the path, from each frame its share (length,)."""
        back = -miss_yaw * share
        own = slice(0, self.length)
        self.poses[own, 0] = quaternion.multiply(turns_about_y(back), self.poses[own, 0])
        x, z = np.diff(self.track[own, [0, 2]].astype(np.float64), axis=0).T
        cosine, sine = np.cos(back[1:]), np.sin(back[1:])
        path = np.zeros((self.length, 2))
        path[1:] = np.cumsum(np.stack([cosine * x + sine * z, cosine * z - sine * x], axis=1), axis=0)
        path += self.track[0, [0, 2]]
        path -= share[:, None] * (path[last] - path[first])
        self.track[own, [0, 2]] = path

    def _fade_over(self) -> None:
        """Write frames period..length: the excerpt's end crossfaded into its start, placed by the step."""
        end, begin = slice(self.period, self.length + 1), slice(0, self.fade + 1)
        weight = np.ones(self.fade + 1, dtype=np.float32)
        weight[:-1] = ease(np.arange(self.fade) / max(self.fade, 1))
        entering, track = self.poses[begin].copy(), self.track[begin].copy()
        turn = turns_about_y(np.array(self.step.yaw)).astype(np.float32)
        entering[:, 0] = quaternion.multiply(turn, entering[:, 0])
        track[:, 0], track[:, 2] = self.step.point(track[:, 0], track[:, 2])
        leaving = self.poses[end].copy()
        leaving[-1] = self.poses[self.length - 1]  # the frame of weight 0; it only lends its signs
        middle = (self.fade + 1) // 2
        flip = quaternion.sides(leaving[middle], entering[middle])
        joints = leaving.shape[1]
        Slerp((self.fade + 1) * joints, short=False)(
            leaving.reshape(-1, 4),
            (entering * flip).astype(np.float32).reshape(-1, 4),
            np.repeat(weight, joints),
            self.poses[end].reshape(-1, 4),
        )
        self.track[end] += weight[:, None] * (track - self.track[end])


def is_closed(poses: FloatArray, roots: FloatArray) -> bool:
    """Whether the step from the last frame to the first one is like the steps before and after it."""
    around = np.array([-2, -1, 0, 1])
    turns = quaternion.angle_between(poses[around[1:]], poses[around[:-1]])
    moves = np.linalg.norm(np.diff(roots[around], axis=0), axis=1)
    most_turn = CLOSED_STEP * np.maximum(turns[0], turns[2]) + CLOSED_RADIANS
    return bool(
        (turns[1] <= most_turn).all() and moves[1] <= CLOSED_STEP * max(moves[0], moves[2]) + CLOSED_M
    )


def yaws(turns: Array) -> Array:
    """Heading about +Y in radians of world rotations (..., 4)."""
    angle: Array = 2 * np.arctan2(turns[..., 2], turns[..., 0])
    return angle


def turns_about_y(angle: Array) -> Array:
    """Rotations (..., 4) by angle (radians) about +Y."""
    zero = np.zeros_like(angle)
    return np.stack([np.cos(angle / 2), zero, np.sin(angle / 2), zero], axis=-1)
