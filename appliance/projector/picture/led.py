"""How closely each limb follows the held joint: the answer, as the last second shows it."""

from __future__ import annotations

import numpy as np

from appliance.projector.picture.poses import ROW_S, ROWS, Floats, Poses

LAGS = 8  # rows by which a limb may follow: 0.2 s
LIVELY = 0.55  # figure heights a second (root mean square) of a limb that fully takes part
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
    relative = poses.positions - poses.positions[:, :1]
    speeds = np.linalg.norm(np.diff(relative, axis=0), axis=2) / ROW_S  # (ROWS - 1, J), newest first
    likeness = np.zeros(count)
    for lag in range(LAGS):
        ours = speeds[: len(speeds) - lag]
        weights = _WINDOW[: len(ours), None]
        lead = speeds[lag:, leader, None]
        centred, lead = (value - (weights * value).sum(0) / weights.sum() for value in (ours, lead))
        both = (weights * centred * lead).sum(axis=0)
        sizes = np.sqrt((weights * centred**2).sum(axis=0) * (weights * lead**2).sum(axis=0))
        likeness = np.maximum(likeness, both / np.maximum(sizes, 1e-6))
    moves = np.sqrt((_WINDOW[:, None] * speeds**2).sum(axis=0) / _WINDOW.sum()) / LIVELY
    led = np.clip(likeness, 0.0, 1.0) * np.clip(moves, 0.0, 1.0) * float(holds[leader])
    led[leader] = holds[leader]
    return leader, led.astype(np.float32)
