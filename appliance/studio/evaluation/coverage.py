"""How much of the dancer a dance has, and whether it only repeats one recorded moment.

Poses are compared by the chordal distance of their joints, headings removed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array
from appliance.studio.evaluation.nearest import Floats, columns_of, piecewise, without_heading

SAMPLE = 2000  # recorded poses that coverage and recall look at
NEIGHBOURS = 5
WINDOW_TICKS = np.array([0, 6, 12, 18, 24])  # half a second, as the critic sees it
EVERY = 2  # ticks between recorded half seconds
APART_TICKS = 100  # moments of one stretch that count as different ones
MOMENTS = 16  # searched at once


class RecordedMotion:
    """The recorded stretches (T, M, 4) of a dancer: poses for coverage, half seconds for memorisation."""

    def __init__(self, stretches: Sequence[Array]) -> None:
        parts = [part for part in stretches if len(part)]
        chosen = np.unique(np.linspace(0, sum(map(len, parts)) - 1, SAMPLE).astype(int))
        ends = np.cumsum([len(part) for part in parts])
        within = np.split(chosen, np.searchsorted(chosen, ends[:-1]))
        begins = ends - [len(part) for part in parts]
        some = [part[rows - begin] for part, rows, begin in zip(parts, within, begins, strict=True)]
        self._poses = _level_columns(np.concatenate(some))
        self._radius = _radius(self._poses)
        self._columns = np.concatenate([_level_columns(part[::EVERY]) for part in parts])
        starts, moments, row, moment = [], [], 0, 0
        for part in parts:
            begun = _starts(part, EVERY)
            starts.append(row + begun // EVERY)
            moments.append(moment + begun // APART_TICKS)
            row += -(-len(part) // EVERY)
            moment += len(part) // APART_TICKS + 3  # stretches are never neighbours
        self._starts, every_moment = np.concatenate(starts), np.concatenate(moments)
        self._begins = np.flatnonzero(np.diff(every_moment, prepend=-9))
        self._moments = every_moment[self._begins]

    def coverage(self, danced: Array) -> float:
        """Share of the recorded poses with a danced one in their neighbourhood (Naeem et al. 2020).

        danced: poses (T, M, 4). Their neighbourhood reaches to the fifth nearest recorded pose.
        """
        nearest = _squared(self._poses, _level_columns(danced)).min(axis=1)
        return float((nearest <= self._radius).mean())

    def recall(self, danced: Array) -> float:
        """Share of the recorded poses in the neighbourhood of a danced one (Kynkaanniemi et al. 2019)."""
        columns = _level_columns(danced)
        return float((_squared(self._poses, columns) <= _radius(columns)[None]).any(axis=1).mean())

    def nearest_moments(self, dances: Sequence[Array], every: int, held: int) -> tuple[float, float]:
        """How far half seconds of dances (T, M, 4) are from the nearest recorded ones, joint `held` left out.

        One each `every` ticks is looked at. The mean distance in degrees of a joint; and how much nearer that
        is than the nearest one of another moment, 2 s away: 1 if not at all, 0 if it is that recording. NaN
        for less than half a second.
        """
        asked = np.concatenate(
            [_half_seconds(_level_columns(danced), _starts(danced, every), WINDOW_TICKS) for danced in dances]
        )
        if not len(asked) or len(self._begins) < 3:
            return float("nan"), float("nan")
        asked = _without(asked, held)
        apart = self._from_moments(asked, held)
        best, near = apart.argmin(axis=1), np.sqrt(apart.min(axis=1))
        apart[np.abs(self._moments[None] - self._moments[best][:, None]) <= 1] = np.inf
        other = np.sqrt(apart.min(axis=1))
        degrees = np.degrees(2 * np.arcsin(np.minimum(near / np.sqrt(8 / 9 * asked.shape[1]), 1)))
        seen = np.isfinite(other)
        share = near[seen] / np.maximum(other[seen], 1e-6)
        return float(degrees.mean()), float(share.mean()) if len(share) else float("nan")

    def _from_moments(self, asked: Floats, held: int) -> Floats:
        """(N, moments): squared distances of half seconds (N, D) from the nearest of each recorded moment.

        A few moments at a time: all half seconds of an hour are 280 MB.
        """
        ends, found = [*self._begins[1:], len(self._starts)], []
        for first in range(0, len(self._begins), MOMENTS):
            begins = self._begins[first : first + MOMENTS]
            starts = self._starts[begins[0] : ends[first + len(begins) - 1]]
            known = _without(_half_seconds(self._columns, starts, WINDOW_TICKS // EVERY), held)
            found.append(np.minimum.reduceat(_squared(asked, known), begins - begins[0], axis=1))
        return np.concatenate(found, axis=1)


def _starts(poses: Array, every: int) -> NDArray[np.intp]:
    """First ticks of the half seconds of poses (T, M, 4)."""
    return np.arange(0, max(0, len(poses) - int(WINDOW_TICKS[-1])), every)


def _without(halves: Floats, joint: int) -> Floats:
    """Half seconds (N, D) without one joint."""
    by_joint = halves.reshape(len(halves), len(WINDOW_TICKS), -1, 9)
    rest: Floats = np.delete(by_joint, joint, axis=2).reshape(len(halves), -1)
    return rest


def _half_seconds(columns: Floats, starts: NDArray[np.intp], window: NDArray[np.intp]) -> Floats:
    """(N, D): rows of columns (R, C) at each start, in the steps of a window."""
    seen = columns[starts[:, None] + window]
    halves: Floats = seen.reshape(len(starts), len(window) * columns.shape[1])
    return halves


def _level_columns(poses: Array) -> Floats:
    """(T, 9 M) of poses (T, M, 4), headings removed."""
    return piecewise(lambda piece: columns_of(without_heading(piece)), poses)


def _squared(a: Floats, b: Floats) -> Floats:
    """(N, M): squared distances of rows."""
    apart: Floats = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None] - 2 * (a @ b.T)
    return np.maximum(apart, 0, out=apart)


def _radius(columns: Floats) -> Floats:
    """(N,): squared distance of each row from its fifth nearest other one."""
    count = min(NEIGHBOURS, len(columns) - 1)
    radius: Floats = np.partition(_squared(columns, columns), count, axis=1)[:, count]
    return radius
