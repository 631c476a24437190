"""How far a variation is from its phrase, and how much of that is timing: dynamic time warping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.evaluation.nearest import without_heading

REACH_S = 1.0  # a pose may be compared with one that is danced this much earlier or later
FPS = 50.0


@dataclass(frozen=True)
class Difference:
    """degrees: mean joint angle at the same ticks; warped: at the ticks that fit best; shift_s: how far
    apart those are in the mean.
    """

    degrees: float
    warped: float
    shift_s: float

    @property
    def timing(self) -> float:
        """Share of the difference that warping takes away, 0 to 1."""
        return 1 - self.warped / self.degrees if self.degrees > 1e-6 else 0.0


def difference(phrase: Array, variation: Array) -> Difference:
    """Of poses (T, M, 4) each; the headings are removed, the longer one is cut."""
    count = min(len(phrase), len(variation))
    costs = _costs(without_heading(phrase[:count]), without_heading(variation[:count]))
    pairs = warping_path(costs, round(REACH_S * FPS))
    one, other = np.array(pairs).T
    return Difference(
        degrees=float(np.trace(costs)) / count,
        warped=float(costs[one, other].mean()),
        shift_s=float(np.abs(one - other).mean()) / FPS,
    )


def warping_path(costs: Array, reach: int) -> list[tuple[int, int]]:
    """The cheapest way through costs (T, T) from corner to corner, at most `reach` beside the diagonal.

    A step along one side alone costs as a step along both, so a detour pays only if it fits better.
    """
    count = len(costs)
    total = np.full((count + 1, count + 1), np.inf)
    total[0, 0] = 0.0
    for row in range(count):
        for column in range(max(0, row - reach), min(count, row + reach + 1)):
            before = min(total[row, column], total[row, column + 1], total[row + 1, column])
            total[row + 1, column + 1] = costs[row, column] + before
    row = column = count - 1
    path = [(row, column)]
    while row or column:
        ways = {
            (row - 1, column - 1): total[row, column],
            (row - 1, column): total[row, column + 1],
            (row, column - 1): total[row + 1, column],
        }
        row, column = min(ways, key=lambda way: ways[way])
        path.append((row, column))
    return path[::-1]


def _costs(one: Array, other: Array) -> Array:
    """(T, T): mean joint angle in degrees between every two poses."""
    rows = [np.degrees(quaternion.angle_between(pose[None], other)).mean(axis=1) for pose in one]
    costs: Array = np.stack(rows)
    return costs
