"""Coupling: how much each joint depends on the held one, above chance, within a moment of time.

Dependence is centred kernel alignment (Kornblith et al. 2019: the Hilbert-Schmidt independence criterion of
Gretton et al. 2005, normalised): 0 for independent motions, 1 for one that follows from the other. Two dances
of one rhythm are alike by chance; so the mean over shifts in time of a second and more is subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array

EVERY = 6  # ticks between the poses that are compared
LAGS = np.arange(-3, 4)  # in hops: up to 0.36 s before and after
AWAY = 8  # in hops, 1 s: a shift from which on two motions count as unrelated
SHIFTS = 24  # so many of them, evenly
LEAST_POSES = 4 * AWAY


def coupling(dances: Sequence[Array], hands: Sequence[Array]) -> Array:
    """(M,): dependence of each joint of the dances (T, M, 4) on the hands (T, 4), mean over the dances.

    The strongest of LAGS counts, in time and in the shifted dances alike. NaN if one is shorter than 4 s.
    """
    found = [_dependence(danced[::EVERY], hand[::EVERY]) for danced, hand in zip(dances, hands, strict=True)]
    mean: Array = np.mean(found, axis=0)
    return mean


def coupling_fidelity(danced: Array, recorded: Array) -> float:
    """Coupling of a dance (M,) as a share of the recordings' own (M,), mean over joints; 1: as coupled."""
    own = float(np.mean(recorded))
    return float(np.mean(danced)) / own if own > 0 else float("nan")


def _dependence(poses: Array, hand: Array) -> Array:
    """(M,) of poses (N, M, 4) on a hand (N, 4)."""
    count, joints = poses.shape[:2]
    if count < LEAST_POSES:
        return np.full(joints, np.nan)
    rows = np.stack([_kernel(poses[:, joint]).ravel() for joint in range(joints)])
    held = _kernel(hand)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True) + 1e-9
    held /= np.linalg.norm(held) + 1e-9

    def strongest(shift: int) -> Array:
        alike = [rows @ np.roll(held, (shift + lag, shift + lag), (0, 1)).ravel() for lag in LAGS]
        largest: Array = np.max(alike, axis=0)
        return largest

    shifts = np.unique(np.linspace(AWAY, count - AWAY, SHIFTS).astype(int))
    chance = np.mean([strongest(int(shift)) for shift in shifts], axis=0)
    above: Array = (strongest(0) - chance) / np.maximum(1 - chance, 1e-6)
    return above


def _kernel(turns: Array) -> Array:
    """(N, N): how alike the orientations (N, 4) of a joint are, centred; as wide as their median distance."""
    six = quaternion.to_6d(turns)
    apart = ((six[:, None] - six[None]) ** 2).sum(axis=-1)
    alike = np.exp(-apart / max(float(np.median(apart)), 1e-9))
    centred: Array = alike - alike.mean(axis=0) - alike.mean(axis=1, keepdims=True) + alike.mean()
    return centred
