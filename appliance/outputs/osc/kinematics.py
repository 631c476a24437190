"""How joints move, as XSens2Osc and MocapAnalysis of the AI-Toolbox send it: velocities to jerks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.motion_features import PAUSE_S, Derivatives
from appliance.pose import quaternion

Floats = NDArray[np.float32]

KINEMATICS = {"lin_vel": 3, "lin_acc": 3, "lin_jerk": 1, "rot_vel": 3, "rot_acc": 3, "ang_jerk": 1}


class Kinematics:
    """Differences between one frame and the next, not smoothed.

    lists: by name, a row a joint: lin_vel, lin_acc (R, 3) in the units and axes of the positions; rot_vel,
    rot_acc (R, 3): radians about these axes; lin_jerk, ang_jerk (R, 1): their size.
    """

    def __init__(self, rows: int) -> None:
        self._moves, self._turns = Derivatives(rows, 3), Derivatives(rows, 2)
        self._turned, self._time = np.zeros((rows, 4), np.float32), -np.inf
        self.lists: dict[str, Floats] = {
            name: np.zeros((rows, width), np.float32) for name, width in KINEMATICS.items()
        }

    def take_frame(self, positions: Floats, rotations: Floats, seconds: float) -> None:
        """Positions (R, 3) and world rotations (R, 4) at a time; without time passed nothing is new."""
        passed_s, lists = seconds - self._time, self.lists
        if passed_s <= 0.0:
            return
        if passed_s > PAUSE_S:
            self._moves.begin()
            self._turns.begin()
            lists["rot_vel"][:] = 0.0
        else:
            turn = quaternion.multiply(rotations, quaternion.inverse(self._turned))
            sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
            angle = 2.0 * np.arctan2(sine, np.abs(turn[:, :1])) * np.copysign(1.0, turn[:, :1])
            lists["rot_vel"][:] = turn[:, 1:] * angle / (np.maximum(sine, 1e-9) * passed_s)
            self._turns.take(lists["rot_vel"], passed_s)
        self._moves.take(positions, passed_s)
        self._turned[:], self._time = rotations, seconds
        lists["lin_vel"][:], lists["lin_acc"][:], jerk = self._moves.found
        lists["rot_acc"][:], turning = self._turns.found
        lists["lin_jerk"][:, 0], lists["ang_jerk"][:, 0] = (
            np.linalg.norm(one, axis=1) for one in (jerk, turning)
        )
