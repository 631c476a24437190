"""Dependence of two dancers: how much one dances as the other one does, above chance, and who comes first.

As coupling.py measures it between a hand and a body: centred kernel alignment, of parts of the body (trunk,
arms, legs), each by its pose and how it moves, the mean over pairs of parts. Two dances to one rhythm are
alike by chance: dances shifted against each other by a second and more give that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.evaluation.limbs import limbs_of

EVERY = 6  # ticks between the poses that are compared
TICK_S = 0.02
MOST_LAG = 12  # hops, 1.44 s
AWAY = 20  # hops, 2.4 s: from this shift on two dances count as unrelated
SHIFTS = 24
STRETCH, STRETCH_HOP = 67, 22  # hops, 8 s: of this length one dancer or the other comes first


class Dependence(NamedTuple):
    """above: the strongest dependence above chance, at its lag; lag_s: seconds by which the second dancer
    comes after the first; profile (L,): above chance at each lag, the second dancer earlier first.
    """

    above: float
    lag_s: float
    profile: Array


def dependence(first: Array, second: Array, joints: Sequence[str]) -> Dependence:
    """How far one dance depends on another, both (T, M, 4), headings removed. NaN below 8 s."""
    one, two = _kernels(first, joints), _kernels(second, joints)
    count = min(one.shape[-1], two.shape[-1])
    if count < 3 * AWAY:
        return Dependence(float("nan"), float("nan"), np.full(2 * MOST_LAG + 1, np.nan))
    one, two = _normed(one[:, :count, :count]), _normed(two[:, :count, :count])
    lags = np.arange(-MOST_LAG, MOST_LAG + 1)
    own = _along(one, two, lags)
    shifts = np.unique(np.linspace(AWAY + MOST_LAG, count - AWAY - MOST_LAG, SHIFTS).astype(int))
    chance = np.array([_along(one, two, lags + shift) for shift in shifts])
    profile = own - chance.mean()
    above = float(own.max() - chance.max(axis=1).mean())
    return Dependence(above, float(lags[own.argmax()]) * EVERY * TICK_S, profile)


def share_led_by_second(first: Array, second: Array, joints: Sequence[str]) -> float:
    """Share of stretches of 8 s in which the second dancer comes before the first. NaN for short dances."""
    one, two = _kernels(first, joints), _kernels(second, joints)
    count = min(one.shape[-1], two.shape[-1])
    lags = np.arange(-MOST_LAG, MOST_LAG + 1)
    leads = []
    for start in range(0, count - STRETCH + 1, STRETCH_HOP):
        part = slice(start, start + STRETCH)
        found = _along(_normed(one[:, part, part]), _normed(two[:, part, part]), lags, wraps=False)
        leads.append(float(found[:MOST_LAG].max() > found[MOST_LAG + 1 :].max()))
    return float(np.mean(leads)) if leads else float("nan")


def likeness(first: Array, second: Array, pairs: Sequence[int]) -> float:
    """How near the second dancer's pose is to the first one's, or to its mirror image, degrees a joint, as a
    share of what it is at other moments; 1: no nearer than by chance, 0: a copy, or a mirror.

    pairs (M,): for each joint its counterpart on the other side.
    """
    count = min(len(first), len(second))
    first, second = first[:count:EVERY], second[:count:EVERY]
    mirrored = first[:, list(pairs)] * np.array([1, 1, -1, -1])

    def apart(shift: int) -> float:
        other = np.roll(second, shift, axis=0)
        return min(
            float(np.degrees(quaternion.angle_between(one, other)).mean()) for one in (first, mirrored)
        )

    shifts = np.linspace(AWAY, len(first) - AWAY, 12).astype(int)
    return apart(0) / float(np.mean([apart(int(shift)) for shift in shifts]))


def _along(one: Array, two: Array, lags: NDArray[np.int_], wraps: bool = True) -> Array:
    """(L,): mean alignment of all parts of one (P, N, N) with those of two, each lag later."""
    found = []
    for lag in lags:
        if wraps:
            other = np.roll(two, (-lag, -lag), axis=(1, 2))
            found.append(np.einsum("pij,qij->", one, other, optimize=True))
            continue
        count = one.shape[1] - abs(lag)
        here, there = (max(0, -lag), max(0, lag))
        a = one[:, here : here + count, here : here + count]
        b = two[:, there : there + count, there : there + count]
        found.append(np.einsum("pij,qij->", _normed(a), _normed(b), optimize=True))
    values: Array = np.array(found) / (len(one) * len(two))
    return values


def _kernels(poses: Array, joints: Sequence[str]) -> Array:
    """(P, N, N): how alike the moments of each part of the body are, not centred."""
    poses = np.asarray(poses, float)
    turns = quaternion.multiply(poses[EVERY:], quaternion.inverse(poses[:-EVERY]))
    axes, angles = quaternion.to_axis_angle(turns)
    motion = (axes * angles[..., None])[::EVERY]
    still = quaternion.to_6d(poses[:-EVERY:EVERY])
    return np.stack([_kernel(_scaled(still[:, part]), _scaled(motion[:, part])) for part in _parts(joints)])


def _parts(joints: Sequence[str]) -> list[list[int]]:
    parts = list(limbs_of(joints).values())
    return parts or [[joint] for joint in range(len(joints))]


def _scaled(values: Array) -> Array:
    """(N, D) of mean square 1 altogether."""
    flat = values.reshape(len(values), -1)
    flat = flat - flat.mean(axis=0)
    scaled: Array = flat / max(float(np.sqrt((flat**2).sum(axis=1).mean())), 1e-9)
    return scaled


def _kernel(*values: Array) -> Array:
    rows = np.concatenate(values, axis=1)
    squares = (rows**2).sum(axis=1)
    apart = np.maximum(squares[:, None] + squares - 2 * rows @ rows.T, 0)
    alike: Array = np.exp(-apart / max(float(np.median(apart)), 1e-9)).astype(np.float32)
    return alike


def _normed(kernels: Array) -> Array:
    """Centred, of length 1."""
    rows = kernels.mean(axis=2, keepdims=True)
    centred = kernels - rows - rows.transpose(0, 2, 1) + kernels.mean(axis=(1, 2), keepdims=True)
    normed: Array = centred / (np.sqrt((centred**2).sum(axis=(1, 2), keepdims=True)) + 1e-9)
    return normed
