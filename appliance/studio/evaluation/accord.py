"""Accord: does one dancer do what couples let one expect beside the other?

A ridge regression, learned on other couples, foretells one dancer's poses and motion from what the other did
in the last second and a half. Accord is the correlation with what was danced, above that with the dance
shifted in time. So it has a sign: a couple's is positive, indifference has none, contrast has less than none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array

EVERY = 6  # ticks between the moments that are compared
LAGS = np.arange(0, 13, 2)  # lags at which the other one is seen: up to 1.4 s
AWAY, SHIFTS = 20, 12  # from the shift `AWAY` on two dances count as unrelated
KEPT_SEEN, KEPT_DANCED = 60, 24  # principal components
MOTION, RIDGE = 3.0, 0.3


class Accord:
    """Learned from couples (first, second), poses (T, M, 4) without headings; it foretells the second."""

    def __init__(self, couples: Sequence[tuple[Array, Array]]) -> None:
        parts = [_both(first, second) for first, second in couples]
        seen, danced = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        self._seen, self._danced = _components(seen, KEPT_SEEN), _components(danced, KEPT_DANCED)
        x, y = seen @ self._seen, danced @ self._danced
        self._weights = np.linalg.solve(x.T @ x + RIDGE * len(x) * np.eye(x.shape[1]), x.T @ y)

    def __call__(self, first: Array, second: Array) -> float:
        """NaN for dances below some 7 s."""
        seen, danced = _both(first, second)
        if len(seen) < 3 * AWAY:
            return float("nan")
        foretold, own = seen @ self._seen @ self._weights, danced @ self._danced

        def alike(shift: int) -> float:
            other = np.roll(own, shift, axis=0)
            return float((foretold * other).sum() / np.sqrt((foretold**2).sum() * (other**2).sum()))

        shifts = np.linspace(AWAY, len(own) - AWAY, SHIFTS).astype(int)
        return alike(0) - float(np.mean([alike(int(shift)) for shift in shifts]))


def _both(first: Array, second: Array) -> tuple[Array, Array]:
    """The first at all lags, and the dance of the second, centred, (N, D) each."""
    one, two = _features(first), _features(second)
    count, late = min(len(one), len(two)), int(LAGS[-1])
    seen = np.concatenate([one[late - lag : count - lag] for lag in LAGS], axis=1)
    danced = two[late:count]
    return seen - seen.mean(axis=0), danced - danced.mean(axis=0)


def _features(poses: Array) -> Array:
    turns = quaternion.multiply(poses[EVERY:], quaternion.inverse(poses[:-EVERY]))
    axes, angles = quaternion.to_axis_angle(turns)
    motion = (axes * angles[..., None])[::EVERY]
    still = quaternion.to_6d(poses[:-EVERY:EVERY])
    return np.concatenate([part.reshape(len(still), -1) for part in (still, MOTION * motion)], axis=1)


def _components(rows: Array, kept: int) -> Array:
    """(D, kept): principal directions, each over its deviation."""
    _, deviations, directions = np.linalg.svd(rows, full_matrices=False)
    kept = min(kept, int((deviations > 1e-6 * deviations[0]).sum()))
    found: Array = directions[:kept].T / (deviations[:kept] / np.sqrt(len(rows)))
    return found
