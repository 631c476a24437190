"""How closely limbs follow the held joint, or those of a partner: the answer, as the last second shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.projector.picture.poses import ROW_S, ROWS, Floats, Poses

LAGS = 8  # rows by which a limb may follow: 0.2 s
LIVELY = 0.55  # figure heights a second (root mean square) of a limb that fully takes part
COUPLED_LAGS = 20  # rows by which a partner may be late: half a second
BY_CHANCE = 0.7  # likeness that unrelated dances reach in a second
HELD = 0.05  # how firmly a joint is held at least, to lead

_WINDOW = np.hanning(2 * ROWS)[ROWS:-1].astype(np.float32)  # the past fades, so that nothing jumps


def led_by(poses: Poses, holds: Floats | None) -> tuple[int | None, Floats]:
    """The joint that leads, None without a hand, and how far each joint (J,) follows it, 0 to 1.

    That is how alike the speeds of both are, about the root, over the last second (the largest correlation
    at a lag up to LAGS), times how much the joint moves.
    """
    count = poses.positions.shape[1]
    if holds is None or not len(holds) or float(holds.max()) < HELD:
        return None, np.zeros(count, np.float32)
    leader = int(np.argmax(holds))
    speeds = _speeds(poses)
    likeness = _likeness(speeds, speeds[:, leader, None], LAGS)
    led = likeness * _moves(speeds) * float(holds[leader])
    led[leader] = holds[leader]
    return leader, led.astype(np.float32)


def coupled(first: Poses, second: Poses) -> Floats:
    """How alike each joint (J,) of two figures moves, whichever of them is later, 0 to 1.

    As in led_by, at lags up to COUPLED_LAGS both ways; likeness that two unrelated dances reach as well is
    left out.
    """
    ours, theirs = _speeds(first), _speeds(second)
    likeness = np.maximum(_likeness(ours, theirs, COUPLED_LAGS), _likeness(theirs, ours, COUPLED_LAGS))
    beyond = np.clip((likeness - BY_CHANCE) / (1.0 - BY_CHANCE), 0.0, 1.0)
    return (beyond * np.minimum(_moves(ours), _moves(theirs))).astype(np.float32)


def _speeds(poses: Poses) -> Floats:
    """Speeds of the joints about the root, (ROWS - 1, J) figure heights a second, newest first."""
    relative = poses.positions - poses.positions[:, :1]
    found: Floats = np.linalg.norm(np.diff(relative, axis=0), axis=2) / ROW_S
    return found


def _likeness(late: Floats, early: Floats, lags: int) -> NDArray[np.float64]:
    """The largest correlation (J,), 0 to 1, of speeds with others, which they follow within so many rows."""
    found = np.zeros(late.shape[1])
    for lag in range(lags):
        ours, theirs = late[: len(late) - lag], early[lag:]
        weights = _WINDOW[: len(ours), None]
        ours, theirs = (value - (weights * value).sum(0) / weights.sum() for value in (ours, theirs))
        both = (weights * ours * theirs).sum(axis=0)
        sizes = np.sqrt((weights * ours**2).sum(axis=0) * (weights * theirs**2).sum(axis=0))
        found = np.maximum(found, both / np.maximum(sizes, 1e-6))
    return np.clip(found, 0.0, 1.0)


def _moves(speeds: Floats) -> NDArray[np.float64]:
    """How much each joint takes part, 0 to 1."""
    mean_speed = np.sqrt((_WINDOW[:, None] * speeds**2).sum(axis=0) / _WINDOW.sum())
    return np.asarray(np.clip(mean_speed / LIVELY, 0.0, 1.0))
