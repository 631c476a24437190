"""Two versions of a dance aligned in time: dynamic time warping with a bounded slope and open ends.

The steps are Sakoe and Chiba's symmetric ones of slope 1/2 to 2 (1978, table I, P = 1): neither dance stops
while the other goes on, so a held pose cannot hide a missing movement. Ticks before the first pair and after
the last one cost as much as a usual pair.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import FPS
from appliance.studio.studio_error import StudioError

COARSE = 5  # ticks from one pose to the next in the first search
BAND = 15  # ticks on either side of what it found that the second one searches
REACH_S = 10.0  # by which one of the dances may begin or end before the other
DETOUR_DEGREES = 0.25  # what a step off the diagonal and a tick left out cost: of equal ways the straight one
SMOOTH_S = 0.8  # shorter changes of tempo are only the ticks' steps
AT_ONCE = 64  # rows of costs: 64 by 1,500 of 20 joints take 60 MB
EDGE_S = 0.5  # left out of the tempo at both ends, where the smoothing has one side only

Places = NDArray[np.intp]


@dataclass(frozen=True)
class Alignment:
    """first: the first tick of the teacher that has a counterpart; ticks (N,): where the student is at it and
    at those that follow, in ticks and fractions.
    """

    first: int
    ticks: Array

    @property
    def tempo(self) -> float:
        """The student's tempo, of the teacher's: 1.1 is faster."""
        return float(1 / self._line[0])

    @property
    def late_s(self) -> float:
        """How much later than the teacher the student is, in the mean."""
        return float((self.ticks - self._own).mean() / FPS)

    @property
    def late_at_first_s(self) -> float:
        """The same at the first tick."""
        slope, start = self._line
        return float((start + (slope - 1) * self.first) / FPS)

    @property
    def unsteady_s(self) -> float:
        """Root mean square by which the student is early or late of an even tempo."""
        slope, start = self._line
        return float(np.sqrt(((self.ticks - start - slope * self._own) ** 2).mean()) / FPS)

    @property
    def tempo_over_time(self) -> Array:
        """(N,): the student's tempo at each tick, of the teacher's."""
        slopes: Array = np.gradient(self.ticks) if len(self.ticks) > 1 else np.ones(1)
        return 1 / np.clip(slopes, 0.5, 2.0)

    @property
    def _own(self) -> Array:
        return self.first + np.arange(len(self.ticks), dtype=float)

    @property
    def _line(self) -> tuple[float, float]:
        """Slope and start of the straight line nearest to the ticks."""
        edge = round(EDGE_S * FPS) if len(self.ticks) > 6 * EDGE_S * FPS else 0
        inner = slice(edge, len(self.ticks) - edge)
        slope, start = np.polyfit(self._own[inner], self.ticks[inner], 1)
        return float(slope), float(start)


def align(teacher: Array, student: Array) -> Alignment:
    """Poses (T, M, 4) and (S, M, 4) at 50 Hz, without headings.

    Raises StudioError where one is more than about twice as long as the other.
    """
    one, other = (each[::COARSE] for each in (teacher, student))
    everywhere = np.broadcast_to(np.arange(len(other)), (len(one), len(other)))
    costs = _costs(one, other, everywhere)
    skip = float(np.median(costs.min(axis=1))) + DETOUR_DEGREES
    few = COARSE * _warped(costs, np.zeros(len(one), dtype=int), len(other), skip, REACH_S * FPS / COARSE)
    rows = np.arange(len(teacher))
    found = np.interp(rows, few[:, 0], few[:, 1])
    found += np.minimum(rows - few[0, 0], 0) + np.maximum(rows - few[-1, 0], 0)
    width = min(2 * BAND + 1, len(student))
    lows = np.clip(np.round(found).astype(int) - BAND, 0, len(student) - width)
    costs = _costs(teacher, student, lows[:, None] + np.arange(width))
    pairs = _warped(costs, lows, len(student), skip, REACH_S * FPS)
    own = np.unique(pairs[:, 0])
    ticks = np.bincount(pairs[:, 0], pairs[:, 1])[own] / np.bincount(pairs[:, 0])[own]
    return Alignment(int(own[0]), np.clip(_smoothed(ticks), 0, len(student) - 1))


def _warped(costs: Array, lows: Places, columns: int, skip: float, most: float) -> Places:
    """(P, 2): the cheapest pairs of ticks. costs (R, W): of row i with the W columns from lows[i] on; most:
    ticks of either that may be left out at each end.

    Raises StudioError where no way leads from one end to the other.
    """
    rows, width = costs.shape
    reach = min(round(most), rows // 2, columns // 2)
    totals = np.full((rows, width), np.inf)
    ways = np.zeros((rows, width), np.int8)
    nothing = np.full(width, np.inf)

    def before(values: Array, row: int, up: int, left: int) -> Array:
        """Values of the row `up` above, `left` columns to the left."""
        if row < up:
            return nothing
        at = lows[row] + np.arange(width) - left - lows[row - up]
        known = (at >= 0) & (at < width)
        return np.where(known, values[row - up, np.clip(at, 0, width - 1)], np.inf)

    for row in range(rows):
        places, here = lows[row] + np.arange(width), costs[row]
        left_out = np.where(places == 0, row, np.where(row == 0, places, reach + 1))
        steps = np.stack(
            [
                np.where(left_out <= reach, left_out * skip, np.inf) + 2 * here,
                before(totals, row, 1, 1) + 2 * here,
                before(totals, row, 2, 1) + 2 * before(costs, row, 1, 0) + here + DETOUR_DEGREES,
                before(totals, row, 1, 2) + 2 * before(costs, row, 0, 1) + here + DETOUR_DEGREES,
            ]
        )
        ways[row] = steps.argmin(axis=0)
        totals[row] = steps.min(axis=0)
    return _way_back(totals, ways, lows, columns, reach, skip)


def _way_back(
    totals: Array, ways: NDArray[np.int8], lows: Places, columns: int, reach: int, skip: float
) -> Places:
    """The pairs from the last one back."""
    rows, width = ways.shape
    last = lows[-1] + np.arange(width)
    ends = {
        (rows - 1, int(place)): float(total) + skip * (columns - 1 - place)
        for place, total in zip(last, totals[-1], strict=True)
        if 0 <= columns - 1 - place <= reach
    }
    for row in range(max(0, rows - 1 - reach), rows - 1):
        at = columns - 1 - lows[row]
        if 0 <= at < width:
            ends[row, columns - 1] = float(totals[row][at]) + skip * (rows - 1 - row)
    row, place = min(ends, key=lambda end: ends[end])
    if not np.isfinite(ends[row, place]):
        raise StudioError(
            "One of the two is more than twice as long as the other: they cannot be versions of one dance. "
            "Cut the longer one with --start and --seconds."
        )
    pairs = [(row, place)]
    while way := int(ways[row, place - lows[row]]):
        if way == 2:
            pairs.append((row - 1, place))
        elif way == 3:
            pairs.append((row, place - 1))
        row, place = row - (2 if way == 2 else 1), place - (2 if way == 3 else 1)
        pairs.append((row, place))
    return np.array(pairs[::-1])


def _costs(one: Array, other: Array, places: Places) -> Array:
    """(T, W): mean joint angles in degrees of poses (T, M, 4) and those of (S, M, 4) at places (T, W)."""
    found = np.empty(places.shape)
    for first in range(0, len(one), AT_ONCE):
        rows = slice(first, first + AT_ONCE)
        cosines = np.abs(np.einsum("tjk,twjk->twj", one[rows], other[places[rows]]))
        found[rows] = np.degrees(2 * np.arccos(np.minimum(cosines, 1.0))).mean(axis=-1)
    return found


def _smoothed(ticks: Array) -> Array:
    """Without the steps of whole ticks; a straight line stays as it is up to its ends."""
    half = min(round(SMOOTH_S * FPS / 2), (len(ticks) - 1) // 2)
    if half < 1:
        return ticks.astype(float)
    before, after = (
        2 * ticks[end] - ticks[part]
        for end, part in ((0, slice(half, 0, -1)), (-1, slice(-2, -half - 2, -1)))
    )
    weights = np.hanning(2 * half + 3)[1:-1]
    padded = np.concatenate([before, ticks, after])
    smooth: Array = np.convolve(padded, weights / weights.sum(), mode="valid")
    return smooth
