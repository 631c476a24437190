"""How much of the dancer a dance has, and whether it only repeats one recorded moment.

Poses are compared by the chordal distance of their joints, headings removed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.evaluation.nearest import Floats, without_heading

SAMPLE = 2000  # recorded poses that coverage and recall look at
NEIGHBOURS = 5
WINDOW_TICKS = np.array([0, 6, 12, 18, 24])  # half a second, as the critic sees it
EVERY = 2  # ticks between recorded half seconds
APART_TICKS = 100  # moments of one stretch that count as different ones
ROWS = 64


class RecordedMotion:
    """The recorded stretches (T, M, 4) of a dancer: poses for coverage, half seconds for memorisation."""

    def __init__(self, stretches: Sequence[Array]) -> None:
        level = [without_heading(part).astype(np.float32) for part in stretches if len(part)]
        poses = np.concatenate(level)
        chosen = np.unique(np.linspace(0, len(poses) - 1, SAMPLE).astype(int))
        self._poses = _columns(poses[chosen])
        self._radius = _radius(self._poses)
        halves, moments, begin = [], [], 0
        for part in level:
            starts = _starts(part, EVERY)
            halves.append(_half_seconds(part, starts))
            moments.append(begin + starts // APART_TICKS)
            begin += len(part) // APART_TICKS + 3  # stretches are never neighbours
        self._halves = np.concatenate(halves)
        moment = np.concatenate(moments)
        self._begins = np.flatnonzero(np.diff(moment, prepend=-9))
        self._moments = moment[self._begins]

    def coverage(self, danced: Array) -> float:
        """Share of the recorded poses with a danced one in their neighbourhood (Naeem et al. 2020).

        danced: poses (T, M, 4). Their neighbourhood reaches to the fifth nearest recorded pose.
        """
        nearest = _squared(self._poses, _columns(without_heading(danced))).min(axis=1)
        return float((nearest <= self._radius).mean())

    def recall(self, danced: Array) -> float:
        """Share of the recorded poses in the neighbourhood of a danced one (Kynkaanniemi et al. 2019)."""
        columns = _columns(without_heading(danced))
        return float((_squared(self._poses, columns) <= _radius(columns)[None]).any(axis=1).mean())

    def nearest_moments(self, dances: Sequence[Array], every: int, held: int) -> tuple[float, float]:
        """How far half seconds of dances (T, M, 4) are from the nearest recorded ones, joint `held` left out.

        One each `every` ticks is looked at. The mean distance in degrees of a joint; and how much nearer that
        is than the nearest one of another moment, 2 s away: 1 if not at all, 0 if it is that recording. NaN
        for less than half a second.
        """
        level = [without_heading(danced).astype(np.float32) for danced in dances]
        asked = np.concatenate([_half_seconds(part, _starts(part, every)) for part in level])
        if not len(asked) or len(self._begins) < 3:
            return float("nan"), float("nan")
        asked, known = (_without(halves, held) for halves in (asked, self._halves))
        first, second = [], []
        for begin in range(0, len(asked), ROWS):
            apart = np.minimum.reduceat(_squared(asked[begin : begin + ROWS], known), self._begins, axis=1)
            best = apart.argmin(axis=1)
            first.append(apart.min(axis=1))
            beside = np.abs(self._moments[None] - self._moments[best][:, None]) <= 1
            second.append(np.where(beside, np.inf, apart).min(axis=1))
        near, other = np.sqrt(np.concatenate(first)), np.sqrt(np.concatenate(second))
        degrees = np.degrees(2 * np.arcsin(np.minimum(near / np.sqrt(8 / 9 * known.shape[1]), 1)))
        seen = np.isfinite(other)
        share = near[seen] / np.maximum(other[seen], 1e-6)
        return float(degrees.mean()), float(share.mean()) if len(share) else float("nan")


def _starts(poses: Array, every: int) -> NDArray[np.intp]:
    """First ticks of the half seconds of poses (T, M, 4)."""
    return np.arange(0, max(0, len(poses) - int(WINDOW_TICKS[-1])), every)


def _without(halves: Floats, joint: int) -> Floats:
    """Half seconds (N, D) without one joint."""
    by_joint = halves.reshape(len(halves), len(WINDOW_TICKS), -1, 9)
    rest: Floats = np.delete(by_joint, joint, axis=2).reshape(len(halves), -1)
    return rest


def _half_seconds(poses: Array, starts: NDArray[np.intp]) -> Floats:
    """(N, D) of poses (T, M, 4), headings removed."""
    columns = _columns(poses)
    seen = columns[starts[:, None] + WINDOW_TICKS]
    halves: Floats = seen.reshape(len(starts), len(WINDOW_TICKS) * columns.shape[1])
    return halves


def _columns(poses: Array) -> Floats:
    """(T, 9 M): rotation matrices, whose distance is sqrt(8) sin(angle / 2) for each joint."""
    columns: Floats = quaternion.to_matrix(poses).reshape(len(poses), -1).astype(np.float32)
    return columns


def _squared(a: Floats, b: Floats) -> Floats:
    """(N, M): squared distances of rows."""
    apart: Floats = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None] - 2 * (a @ b.T)
    return np.maximum(apart, 0, out=apart)


def _radius(columns: Floats) -> Floats:
    """(N,): squared distance of each row from its fifth nearest other one."""
    count = min(NEIGHBOURS, len(columns) - 1)
    radius: Floats = np.partition(_squared(columns, columns), count, axis=1)[:, count]
    return radius
