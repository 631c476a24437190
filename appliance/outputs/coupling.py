"""How closely limbs follow the held joint, or those of a partner: the answer, as the last second shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

ROWS = 48  # a trail: row 0 is now, row i was ROW_S * i seconds ago
ROW_S = 0.025  # 48 of them reach 1.175 s back
LAGS = 8  # rows by which a limb may follow: 0.2 s
LIVELY = 0.55  # figure heights a second (root mean square) of a limb that fully takes part
LATE_S, LATE_STEP_S = 0.5, 0.05  # by how much a partner may be late, and the lags that are tried
BY_CHANCE = 0.75  # likeness that strangers reach in one of twenty looks at a second, one of fifty at 2.4 s
FULLY = 0.85  # likeness that counts as full: a couple seldom has more
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
    likeness = _likeness(speeds[..., None], speeds[:, leader, None, None], range(LAGS))
    led = likeness * _moves(speeds) * float(holds[leader])
    led[leader] = holds[leader]
    return leader, led.astype(np.float32)


def coupled(first: Floats, second: Floats, row_s: float = ROW_S) -> Floats:
    """How alike each joint (J,) of two figures moves through the room, whichever is later, 0 to 1.

    Trails as in led_by, their rows row_s apart. Velocities count, not speeds, and the root's are in them: the
    dancers of a couple travel together, while speeds are alike in all dances to such music. Likeness that
    strangers reach as well is left out (docs/notebook.md).
    """
    ours, theirs = _velocities(first, row_s), _velocities(second, row_s)
    step = max(round(LATE_STEP_S / row_s), 1)
    lags = range(0, round(LATE_S / row_s), step)
    likeness = np.maximum(_likeness(ours, theirs, lags), _likeness(theirs, ours, lags))
    beyond = np.clip((likeness - BY_CHANCE) / (FULLY - BY_CHANCE), 0.0, 1.0)
    moves = np.minimum(*(_moves(np.linalg.norm(one, axis=2)) for one in (ours, theirs)))
    return (beyond * moves).astype(np.float32)


def rows_between(
    times: NDArray[np.float64], now: float, row_s: float = ROW_S
) -> tuple[NDArray[np.intp], Floats]:
    """For each row of a trail at `now`: which of the times (N,), at least two, in order, comes after it; and
    how far it is there from the one before (ROWS,), 0 to 1. Rows before the first time are at the first.
    """
    at = np.clip(now - row_s * np.arange(ROWS), times[0], times[-1])
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    step = np.maximum(times[after] - times[after - 1], 1e-9)
    return after, np.clip((at - times[after - 1]) / step, 0.0, 1.0).astype(np.float32)


def _speeds(positions: Floats) -> Floats:
    """Speeds of the joints about the root, (ROWS - 1, J) figure heights a second, newest first."""
    found: Floats = np.linalg.norm(_velocities(positions - positions[:, :1], ROW_S), axis=2)
    return found


def _velocities(positions: Floats, row_s: float) -> Floats:
    """(ROWS - 1, J, 3) figure heights a second, newest first."""
    found: Floats = -np.diff(positions, axis=0) / row_s
    return found


def _likeness(late: Floats, early: Floats, lags: range) -> NDArray[np.float64]:
    """The largest correlation (J,), 0 to 1, of `late` with `early`, both motion (rows, J, C), over these lags
    (rows by which `late` follows). The C components of a joint count as one vector.
    """
    likeness, parts = np.zeros(late.shape[1]), late.shape[2]
    late, early = (one.reshape(len(one), -1) for one in (late, early))
    for lag in lags:
        weights, ours, theirs = _WINDOW[: len(late) - lag], late[: len(late) - lag], early[lag:]
        weighted, total = weights[:, None] * ours, weights.sum()
        mean, beside = weighted.sum(axis=0), weights @ theirs
        both = np.einsum("rj,rj->j", weighted, theirs) - mean * beside / total
        own = np.einsum("rj,rj->j", weighted, ours) - mean**2 / total
        other = weights @ theirs**2 - beside**2 / total
        both, own, other = (one.reshape(-1, parts).sum(axis=1) for one in (both, own, other))
        sizes = np.sqrt(np.maximum(own * other, 0.0))
        likeness = np.maximum(likeness, both / np.maximum(sizes, 1e-6))
    return np.asarray(np.minimum(likeness, 1.0))


def _moves(speeds: Floats) -> NDArray[np.float64]:
    """How much each joint takes part, 0 to 1."""
    mean_speed = np.sqrt((_WINDOW[:, None] * speeds**2).sum(axis=0) / _WINDOW.sum())
    return np.asarray(np.clip(mean_speed / LIVELY, 0.0, 1.0))
