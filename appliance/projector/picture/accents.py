"""Accents: sudden moves of hands and feet in the last second, and how hard a brush presses in each limb."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appliance.outputs.coupling import ROW_S, ROWS
from appliance.outputs.joint_frame import Floats
from appliance.pose.ease import ease
from appliance.projector.picture.poses import Poses

OVER = 4  # rows over which a speed changes: 0.1 s; an accent is told from what came before and after
SOFT, HARD = 1.2, 3.2  # figure heights a second by which a speed changes: no accent, and the strongest
SLOW, FAST = 0.3, 1.8  # figure heights a second: a brush that is pressed down, and one that is lifted
RECENT = 6  # rows whose mean speed counts for the pressure


class Accent(NamedTuple):
    """place, way: (3,) where it was and the velocity before it, in figure heights (a second); strength: 0..1;
    age_s: since then; seed: the same number as long as it is seen."""

    place: Floats
    way: Floats
    strength: float
    age_s: float
    seed: int


def accents(poses: Poses, joints: Sequence[int], time_s: float) -> list[Accent]:
    """The accents of these joints, the newest first. They are found at fixed times of the dance, so that the
    next picture finds the same ones."""
    tick, share = divmod(time_s, ROW_S)
    share /= ROW_S
    found = []
    for joint in joints:
        places = (1 - share) * poses.positions[:-1, joint] + share * poses.positions[1:, joint]
        speeds = (places[:-2] - places[2:]) / (2 * ROW_S)
        changes = np.linalg.norm(speeds[:-OVER] - speeds[OVER:], axis=1)
        for row in range(OVER, len(changes) - OVER):
            strength = ease(min(max((float(changes[row]) - SOFT) / (HARD - SOFT), 0.0), 1.0))
            if strength > 0.0 and changes[row] >= changes[row - OVER : row + OVER + 1].max():
                at, age_s = row + OVER // 2 + 1, (row + OVER // 2 + 1 + share) * ROW_S
                seed = (int(tick) - row) % 4096 * 64 + joint % 64
                found.append(Accent(places[at], speeds[row + OVER], strength, age_s, seed))
    return sorted(found, key=lambda one: one.age_s)


def pressure(poses: Poses) -> Floats:
    """(J,) 0 to 1: how hard a brush is pressed where each joint is; a fast one is lifted."""
    ways = np.linalg.norm(poses.positions[: min(RECENT, ROWS - 1)] - poses.positions[1 : RECENT + 1], axis=2)
    lifted = np.clip((ways.mean(axis=0) / ROW_S - SLOW) / (FAST - SLOW), 0.0, 1.0)
    return np.asarray(1.0 - ease(lifted), np.float32)
