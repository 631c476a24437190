"""Dialect of what moves, as numbers: speeds of each joint, quantity of motion, bounds, efforts after Laban.

Definitions: C. Larboulette and S. Gibet, 'A review of computable expressive descriptors of human motion'
(MOCO 2015); every joint weighs the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.template import message, single
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig

WINDOW = 25  # frames that efforts look back: half a second
PAUSE_S = 0.2  # after which motion begins anew
LEAST_M = 0.001  # no way is shorter: one who stands still goes straight
_DERIVATIVES = ("velocity", "acceleration", "jerk")
_NUMBERS = {"qom": 1, "bbox": 6, "bsphere": 4}
_EFFORTS = ("weight_effort", "time_effort", "flow_effort", "space_effort")

Floats = NDArray[np.float32]


class Features:
    """Velocity, acceleration and jerk (J x x, y, z; metres and seconds), and numbers of the whole body.

    Differences between one frame and the next, not smoothed; a late frame repeats the numbers before it.
    """

    def __init__(self, skeleton: Skeleton, config: OscConfig | None = None) -> None:
        joints, prefix = len(skeleton), (config or OscConfig()).prefix
        whole = prefix.removesuffix("/joint")
        lists = [message(f"{prefix}/{name}", floats=3 * joints) for name in _DERIVATIVES]
        numbers = [message(f"{whole}/{name}", floats=count) for name, count in _NUMBERS.items()]
        self._template = single(
            [*lists, *numbers, *(message(f"{whole}/{name}", floats=1) for name in _EFFORTS)]
        )
        self._places = self._template.places
        self._before = np.zeros((3, joints, 3), np.float32)  # position, velocity, acceleration
        self._derived = np.zeros((3, joints, 3), np.float32)  # velocity, acceleration, jerk
        self._sizes = np.zeros((WINDOW, 3, joints), np.float32)  # of these, the newest frames
        self._steps = np.zeros((WINDOW, joints), np.float32)  # metres from the frame before
        self._ways = np.zeros((WINDOW, joints, 3), np.float32)  # positions
        self._frames, self._time = 0, -np.inf

    def encode(self, frame: JointFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        passed_s = frame.frame_time - self._time
        if not frame.late and passed_s > 0.0:
            self._measure(frame.positions, passed_s)
            self._time = frame.frame_time
        return self._template.datagrams

    def _measure(self, positions: Floats, passed_s: float) -> None:
        if passed_s > PAUSE_S:
            self._frames, passed_s = 0, 1.0
        now = positions
        for order in range(3):  # a derivative begins with the frame that has all that it needs
            if self._frames > order:
                np.divide(now - self._before[order], np.float32(passed_s), out=self._derived[order])
            else:
                self._derived[order] = 0.0
            self._before[order] = now
            now = self._derived[order]
        place = self._frames % WINDOW
        self._sizes[place] = np.sqrt(np.einsum("djk,djk->dj", self._derived, self._derived))
        self._steps[place] = self._sizes[place, 0] * passed_s
        self._ways[place] = positions
        self._frames += 1
        self._write(positions, place)

    def _write(self, positions: Floats, place: int) -> None:
        numbers, places, seen = self._template.numbers, self._places, min(self._frames, WINDOW)
        for order in range(3):
            numbers[places[order]] = self._derived[order].ravel()
        sizes = self._sizes[:seen]
        centre = positions.mean(axis=0)
        numbers[places[3]] = sizes[place, 0].mean()
        numbers[places[4]] = np.concatenate([positions.min(axis=0), positions.max(axis=0)])
        apart = positions - centre
        radius = np.sqrt(np.einsum("jk,jk->j", apart, apart).max())
        numbers[places[5]] = [*centre, radius]
        numbers[places[6]] = np.square(sizes[:, 0]).mean(axis=1).max()
        numbers[places[7]] = sizes[:, 1].mean()
        numbers[places[8]] = sizes[:, 2].mean()
        oldest = self._frames % WINDOW if self._frames >= WINDOW else 0
        way = self._steps[:seen].sum(axis=0) - self._steps[oldest]
        apart = positions - self._ways[oldest]
        far = np.sqrt(np.einsum("jk,jk->j", apart, apart))
        numbers[places[9]] = (np.maximum(way, LEAST_M) / np.maximum(far, LEAST_M)).mean()
