"""Two versions of a dance aligned in time: dynamic time warping with a bounded slope and open ends.

The steps are Sakoe and Chiba's symmetric ones of slope 1/2 to 2 (1978, table I, P = 1): neither dance stops
while the other goes on, so a held pose cannot hide a missing movement. Ticks before the first pair and after
the last one cost as much as a usual pair.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import FPS
from appliance.studio.studio_error import StudioError

COARSE = 5  # ticks from one pose to the next in the first search
BAND = 15  # ticks on either side of what it found that the second one searches
REACH_S = 10.0  # by which one of the dances may begin or end before the other
DETOUR_DEGREES = 0.25  # what a step off the diagonal and a tick left out cost: of equal ways the straight one
SMOOTH_S = 0.8  # of tempo: shorter changes are the ticks' own steps
EDGE_S = 0.5  # left out of the tempo at both ends, where the smoothing has one side only

Places = NDArray[np.intp]
CostRow = Callable[[int, Places], Array]


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
    coarse, low = [each[::COARSE] for each in (teacher, student)], np.zeros
    usual = float(np.median([_costs(coarse[0][row], coarse[1]).min() for row in range(len(coarse[0]))]))
    skip = usual + DETOUR_DEGREES
    few = _warped(
        lambda row, places: _costs(coarse[0][row], coarse[1][places]),
        low(len(coarse[0]), dtype=int),
        len(coarse[1]),
        len(coarse[1]),
        skip,
    )
    rows = np.arange(len(teacher))
    found = np.interp(rows, COARSE * few[:, 0], COARSE * few[:, 1])
    found += np.minimum(rows - COARSE * few[0, 0], 0) + np.maximum(rows - COARSE * few[-1, 0], 0)
    lows = np.clip(np.round(found).astype(int) - BAND, 0, max(0, len(student) - 2 * BAND - 1))
    pairs = _warped(
        lambda row, places: _costs(teacher[row], student[places]), lows, 2 * BAND + 1, len(student), skip
    )
    own = np.unique(pairs[:, 0])
    ticks = np.bincount(pairs[:, 0], pairs[:, 1])[own] / np.bincount(pairs[:, 0])[own]
    return Alignment(int(own[0]), np.clip(_smoothed(ticks), 0, len(student) - 1))


def _warped(cost: CostRow, lows: Places, width: int, columns: int, skip: float) -> Places:
    """(P, 2): the cheapest pairs of ticks. cost: of a row with columns; of row i the `width` from lows[i] on.

    Raises StudioError where no way leads from one end to the other.
    """
    rows, scale = len(lows), COARSE if width == columns else 1
    reach = min(round(REACH_S * FPS / scale), rows // 2, columns // 2)
    totals: list[Array] = []
    costs: list[Array] = []
    ways = np.zeros((rows, width), np.int8)
    for row in range(rows):
        places = lows[row] + np.arange(width)
        inside = places < columns
        here = np.full(width, np.inf)
        here[inside] = cost(row, places[inside])

        def before(values: list[Array], up: int, left: int, row: int = row, places: Places = places) -> Array:
            """Of the row `up` above, as many columns to the left."""
            taken = np.full(width, np.inf)
            if row >= up:
                at = places - left - lows[row - up]
                known = (at >= 0) & (at < width)
                taken[known] = values[row - up][at[known]]
            return taken

        costs.append(here)
        begins = row if row else np.where(places <= reach, places, np.inf)
        begin = np.where((places == 0) | (row == 0), begins * skip, np.inf) if row <= reach else np.inf
        steps = np.stack(
            [
                np.broadcast_to(begin, (width,)) + 2 * here,
                before(totals, 1, 1) + 2 * here,
                before(totals, 2, 1) + 2 * before(costs, 1, 0) + here + DETOUR_DEGREES,
                before(totals, 1, 2) + 2 * before(costs, 0, 1) + here + DETOUR_DEGREES,
            ]
        )
        ways[row] = steps.argmin(axis=0)
        totals.append(steps.min(axis=0))
    return _way_back(totals, ways, lows, columns, reach, skip)


def _way_back(
    totals: list[Array], ways: NDArray[np.int8], lows: Places, columns: int, reach: int, skip: float
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


def _costs(pose: Array, poses: Array) -> Array:
    """Mean joint angle in degrees between a pose (M, 4) and poses (N, M, 4)."""
    apart: Array = np.degrees(quaternion.angle_between(pose[None], poses)).mean(axis=-1)
    return apart


def _smoothed(ticks: Array) -> Array:
    """Without the steps of whole ticks; a straight line stays as it is up to its ends."""
    half = min(round(SMOOTH_S * FPS / 2), (len(ticks) - 1) // 2)
    if half < 1:
        return ticks.astype(float)
    before, after = (2 * ticks[end] - ticks[part] for end, part in ((0, slice(half, 0, -1)), (-1, slice(-2, -half - 2, -1))))
    weights = np.hanning(2 * half + 3)[1:-1]
    padded = np.concatenate([before, ticks, after])
    smooth: Array = np.convolve(padded, weights / weights.sum(), mode="valid")
    return smooth
