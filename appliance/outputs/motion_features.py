"""Movement in numbers: speeds of each joint, quantity of motion, bounds, efforts after Laban.

Definitions: C. Larboulette and S. Gibet, 'A review of computable expressive descriptors of human motion'
(MOCO 2015); every joint weighs the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion

WINDOW = 25  # frames that efforts look back: half a second
PAUSE_S = 0.2  # after which motion begins anew
LEAST_M = 0.001  # no way is shorter: one who stands still goes straight
EFFORTS = ("weight_effort", "time_effort", "flow_effort", "space_effort")

Floats = NDArray[np.float32] | NDArray[np.float64]


class Derivatives:
    """Derivative of vectors, by differences between one frame and the next, not smoothed.

    found (orders, J, 3): the first derivative, the second and so on, by seconds; each begins, after zeros,
    with the frame that has all that it needs.
    """

    def __init__(self, joints: int, orders: int, precision: type = np.float32) -> None:
        self.found: Floats = np.zeros((orders, joints, 3), precision)
        self._before: Floats = np.zeros_like(self.found)
        self._frames = 0

    def begin(self) -> None:
        """Forget what was before."""
        self._frames = 0
        self.found[:] = 0.0

    def take(self, vectors: Floats, passed_s: float) -> None:
        """The next vectors (J, 3), passed_s after the last ones."""
        for order, found in enumerate(self.found):
            if self._frames > order:
                np.divide(vectors - self._before[order], np.float32(passed_s), out=found)
            self._before[order] = vectors
            vectors = found
        self._frames += 1


class MotionFeatures:
    """derived (3, J, 3): velocity, acceleration and jerk of each joint, metres and seconds, world frame.
    numbers: `qom` (1), `bbox` (6: lowest, highest), `bsphere` (4: centre, radius), each of EFFORTS (1).
    """

    def __init__(self, joints: int, precision: type = np.float32) -> None:
        self._derivatives = Derivatives(joints, 3, precision)
        self.derived = self._derivatives.found
        self._sizes: Floats = np.zeros((WINDOW, 3, joints), precision)  # the newest frames among these
        self._steps: Floats = np.zeros((WINDOW, joints), precision)  # metres from the frame before
        self._ways: Floats = np.zeros((WINDOW, joints, 3), precision)  # positions
        self.numbers: dict[str, Floats] = {
            name: np.zeros(count, np.float32)
            for name, count in {"qom": 1, "bbox": 6, "bsphere": 4, **dict.fromkeys(EFFORTS, 1)}.items()
        }
        self._frames, self._time = 0, -np.inf

    def take_frame(self, positions: Floats, seconds: float) -> bool:
        """Positions (J, 3), metres, at a time; whether the numbers are new: time must have passed."""
        passed_s = seconds - self._time
        if passed_s <= 0.0:
            return False
        self._measure(positions, passed_s)
        self._time = seconds
        return True

    def _measure(self, positions: Floats, passed_s: float) -> None:
        if passed_s > PAUSE_S:
            self._frames, passed_s = 0, 1.0
            self._derivatives.begin()
        self._derivatives.take(positions, passed_s)
        place = self._frames % WINDOW
        self._sizes[place] = np.sqrt(np.einsum("djk,djk->dj", self.derived, self.derived))
        self._steps[place] = self._sizes[place, 0] * passed_s
        self._ways[place] = positions
        self._frames += 1
        self._describe(positions, place)

    def _describe(self, positions: Floats, place: int) -> None:
        numbers, seen = self.numbers, min(self._frames, WINDOW)
        sizes = self._sizes[:seen]
        centre = positions.mean(axis=0)
        numbers["qom"][:] = sizes[place, 0].mean()
        numbers["bbox"][:] = np.concatenate([positions.min(axis=0), positions.max(axis=0)])
        apart = positions - centre
        radius = np.sqrt(np.einsum("jk,jk->j", apart, apart).max())
        numbers["bsphere"][:] = [*centre, radius]
        numbers["weight_effort"][:] = np.square(sizes[:, 0]).mean(axis=1).max()
        numbers["time_effort"][:] = sizes[:, 1].mean()
        numbers["flow_effort"][:] = sizes[:, 2].mean()
        oldest = self._frames % WINDOW if self._frames >= WINDOW else 0
        way = self._steps[:seen].sum(axis=0) - self._steps[oldest]
        apart = positions - self._ways[oldest]
        far = np.sqrt(np.einsum("jk,jk->j", apart, apart))
        numbers["space_effort"][:] = (np.maximum(way, LEAST_M) / np.maximum(far, LEAST_M)).mean()


class TurnFeatures:
    """The same of what turns: radians take the place of metres. derived (3, 1, 3): angular velocity,
    acceleration and jerk about the world's axes; numbers: `qom` and the efforts.

    The angle that is measured is the sum of all turns, so that turning round and round is a way like another.
    """

    def __init__(self) -> None:
        self._features = MotionFeatures(1, np.float64)  # the sum grows all evening
        self.derived = self._features.derived
        self.numbers = {name: self._features.numbers[name] for name in ("qom", *EFFORTS)}
        self._before: Floats | None = None
        self._angle = np.zeros((1, 3))

    def take_frame(self, orientation: Floats, seconds: float) -> bool:
        """An orientation (4,) at a time, zeros: unknown; whether the numbers are new."""
        if not orientation.any():
            return False
        if self._before is not None:
            turn = quaternion.multiply(orientation, quaternion.inverse(self._before)).astype(float)
            axis, angle = quaternion.to_axis_angle(turn if turn[0] >= 0.0 else -turn)
            self._angle += axis * angle
        self._before = orientation.copy()
        return self._features.take_frame(self._angle, seconds)
