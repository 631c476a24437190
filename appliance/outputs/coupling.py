"""How closely limbs follow the held joint, or those of a partner: the answer, as the last second shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

ROWS = 48  # a trail: row 0 is now, row i was ROW_S * i seconds ago
ROW_S = 0.025  # 48 of them reach 1.175 s back
LAGS = 8  # rows by which a limb may follow: 0.2 s
LIVELY = 0.55  # figure heights a second (root mean square) of a limb that fully takes part
COUPLED_LAGS = 20  # rows by which a partner may be late: half a second
BY_CHANCE = 0.7  # likeness that unrelated dances reach in a second
HELD = 0.05  # how firmly a joint is held at least, to lead

_WINDOW = np.hanning(2 * ROWS)[ROWS:-1].astype(np.float32)  # the past fades, so that nothing jumps


def led_by(positions: Floats, holds: Floats | None) -> tuple[int | None, Floats]:
    """The joint that leads, None without a hand, and how far each joint (J,) follows it, 0 to 1.

    positions: a trail (ROWS, J, 3), figure heights; holds (J,): how firmly hands hold joints.
    That is how alike the speeds of both are, about the root, over the last second (the largest correlation
    at a lag up to LAGS), times how much the joint moves.
    """
    count = positions.shape[1]
    if holds is None or not len(holds) or float(holds.max()) < HELD:
        return None, np.zeros(count, np.float32)
    leader = int(np.argmax(holds))
    speeds = _speeds(positions)
    likeness = _likeness(speeds, speeds[:, leader, None], LAGS)
    led = likeness * _moves(speeds) * float(holds[leader])
    led[leader] = holds[leader]
    return leader, led.astype(np.float32)


def coupled(first: Floats, second: Floats) -> Floats:
    """How alike each joint (J,) of two figures moves, whichever of them is later, 0 to 1.

    Trails and likeness as in led_by, at lags up to COUPLED_LAGS both ways; likeness that two unrelated dances
    reach as well is left out.
    """
    ours, theirs = _speeds(first), _speeds(second)
    likeness = np.maximum(_likeness(ours, theirs, COUPLED_LAGS), _likeness(theirs, ours, COUPLED_LAGS))
    beyond = np.clip((likeness - BY_CHANCE) / (1.0 - BY_CHANCE), 0.0, 1.0)
    return (beyond * np.minimum(_moves(ours), _moves(theirs))).astype(np.float32)


def rows_between(times: NDArray[np.float64], now: float) -> tuple[NDArray[np.intp], Floats]:
    """For each row of a trail at `now`: which of the times (N,), at least two, in order, comes after it; and
    how far it is there from the one before (ROWS,), 0 to 1. Rows before the first time are at the first.
    """
    at = np.clip(now - ROW_S * np.arange(ROWS), times[0], times[-1])
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    step = np.maximum(times[after] - times[after - 1], 1e-9)
    return after, np.clip((at - times[after - 1]) / step, 0.0, 1.0).astype(np.float32)


def _speeds(positions: Floats) -> Floats:
    """Speeds of the joints about the root, (ROWS - 1, J) figure heights a second, newest first."""
    relative = positions - positions[:, :1]
    found: Floats = np.linalg.norm(np.diff(relative, axis=0), axis=2) / ROW_S
    return found


def _likeness(late: Floats, early: Floats, lags: int) -> NDArray[np.float64]:
    """The largest correlation (J,), 0 to 1, of speeds with others, which they follow within so many rows."""
    late, early = late.astype(float), early.astype(float)
    rows = np.arange(len(late))
    inside = rows < len(rows) - np.arange(lags)[:, None]
    weights = np.where(inside, _WINDOW[: len(rows)], 0.0)  # (lags, rows) of the late ones
    shifted = np.zeros((lags, 2 * len(rows)))  # and of the early ones, which begin a lag later
    for lag in range(lags):
        shifted[lag, lag : lag + len(rows)] = weights[lag]
    padded = np.concatenate([early, np.zeros((lags, early.shape[1]))])
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(rows), axis=0)[:lags]  # (lags, J, rows)
    total = weights.sum(axis=1, keepdims=True)
    ours, theirs = weights @ late, shifted[:, : len(rows)] @ early
    both = np.einsum("ljr,lrj->lj", windows, weights[:, :, None] * late) - ours * theirs / total
    squares = weights @ late**2 - ours**2 / total, shifted[:, : len(rows)] @ early**2 - theirs**2 / total
    sizes = np.sqrt(np.maximum(squares[0] * squares[1], 0.0))
    return np.asarray(np.clip((both / np.maximum(sizes, 1e-6)).max(axis=0), 0.0, 1.0))


def _moves(speeds: Floats) -> NDArray[np.float64]:
    """How much each joint takes part, 0 to 1."""
    mean_speed = np.sqrt((_WINDOW[:, None] * speeds**2).sum(axis=0) / _WINDOW.sum())
    return np.asarray(np.clip(mean_speed / LIVELY, 0.0, 1.0))
