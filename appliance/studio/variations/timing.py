"""Timing of a variation: a phrase at other times, and how much of a difference is timing (time warping)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.evaluation.nearest import without_heading

REACH_S = 1.0  # a pose may be compared with one that is danced this much earlier or later
FPS = 50.0
WAVE_S = 2.5  # half a wave of a changed timing at least: a gesture, not a tremor
MOST_RATE = 0.3  # how much faster or slower than the phrase


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


def retimed(phrase: Recording, seconds: float, seed: int) -> Recording:
    """The phrase at 50 Hz, its gestures earlier or later by `seconds` (root mean square), or by less, so that
    none is faster than MOST_RATE allows; the first and last pose stay in their place.
    """
    count = len(phrase)
    at = np.linspace(0.0, np.pi, count)
    waves = max(1, round(count / FPS / WAVE_S))
    sizes = np.random.default_rng([seed, waves]).standard_normal(waves)
    lag = (sizes[:, None] * np.sin(np.arange(1, waves + 1)[:, None] * at)).sum(axis=0)
    lag *= seconds * FPS / max(float(np.sqrt((lag**2).mean())), 1e-9)
    lag *= min(1.0, MOST_RATE / max(float(np.abs(np.diff(lag)).max()), 1e-9))
    ticks = np.clip(np.arange(count) + lag, 0.0, count - 1.0)
    before = np.minimum(ticks.astype(int), max(count - 2, 0))
    share = ticks - before
    after = np.minimum(before + 1, count - 1)
    poses = quaternion.slerp(phrase.poses[before], phrase.poses[after], share[:, None])
    roots = phrase.roots[before] + share[:, None] * (phrase.roots[after] - phrase.roots[before])
    return replace(phrase, poses=quaternion.continuous(poses), roots=roots)


def difference(phrase: Array, variation: Array) -> Difference:
    """From poses (T, M, 4) each; the headings are removed, the longer one is cut."""
    count = min(len(phrase), len(variation))
    reach = min(round(REACH_S * FPS), count - 1)
    costs = _costs(without_heading(phrase[:count]), without_heading(variation[:count]), reach)
    pairs = np.array(warping_path(costs))
    lags = pairs[:, 1] - pairs[:, 0]
    return Difference(
        degrees=float(costs[:, reach].mean()),
        warped=float(costs[pairs[:, 0], reach + lags].mean()),
        shift_s=float(np.abs(lags).mean()) / FPS,
    )


def warping_path(costs: Array) -> list[tuple[int, int]]:
    """The cheapest way from the first tick of both to the last; costs (T, 2 * reach + 1): of tick t of one
    with tick t - reach, ..., t + reach of the other, infinite where there is none.

    A step along only one side costs as much as a step along both, so a detour pays only if it fits better.
    """
    count, width = costs.shape
    reach = width // 2
    nothing = [math.inf] * (width + 2)  # a column more on both sides
    totals = [nothing]
    for row, line in enumerate(costs.tolist()):
        before, total = totals[-1], nothing.copy()
        for place, cost in enumerate(line, 1):
            total[place] = cost + min(before[place], before[place + 1], total[place - 1])
        if row == 0:  # begins at the first tick of both
            total = [math.inf] * (reach + 1) + list(itertools.accumulate(line[reach:])) + [math.inf]
        totals.append(total)
    row, place = count, reach + 1
    path = [(count - 1, count - 1)]
    while path[-1] != (0, 0):
        ways = {
            (row - 1, place): totals[row - 1][place],
            (row - 1, place + 1): totals[row - 1][place + 1],
            (row, place - 1): totals[row][place - 1],
        }
        row, place = min(ways, key=lambda way: ways[way])
        path.append((row - 1, row + place - reach - 2))
    return path[::-1]


def _costs(one: Array, other: Array, reach: int) -> Array:
    """(T, 2 * reach + 1): mean joint angle in degrees between poses (T, M, 4) at most `reach` ticks apart."""
    count = len(one)
    costs = np.full((count, 2 * reach + 1), np.inf)
    for lag in range(-reach, reach + 1):
        rows = slice(max(0, -lag), count - max(0, lag))
        columns = slice(max(0, lag), count - max(0, -lag))
        apart = quaternion.angle_between(one[rows], other[columns])
        costs[rows, reach + lag] = np.degrees(apart).mean(axis=1)
    return costs
