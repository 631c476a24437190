"""Stream: the played motion, one row of pose and root for each tick; the newest rows are the window."""

from __future__ import annotations

import math

import numpy as np

from appliance.dancer.phrase import AT, LIFT, NUMBER, STANDING, X, Z
from appliance.dancer.slerp import FloatArray

_ROWS = 256  # poses before it moves back to the start of its memory


class Stream:
    """Poses (J, 4) and tracks (C,) of the next `window` ticks, this tick first."""

    SNAPSHOT = ("poses", "tracks")

    def __init__(self, joints: int, columns: int, window: int) -> None:
        self._window, self._end = window, 0
        self._poses = np.zeros((_ROWS, joints, 4), dtype=np.float32)
        self._poses[..., 0] = 1.0
        self._tracks = np.zeros((_ROWS, columns), dtype=np.float32)

    def clear(self) -> None:
        """Empty the stream: append `window` rows before reading."""
        self._end = 0

    def next_row(self) -> tuple[FloatArray, FloatArray]:
        """The arrays for the next pose and its track; `append` then makes them the newest row."""
        if self._end == len(self._poses):
            self._move_to_start()
        return self._poses[self._end], self._tracks[self._end]

    def append(self) -> None:
        """Append what was written into next_row."""
        self._end += 1

    @property
    def poses(self) -> FloatArray:
        """The window's poses (window, J, 4); valid until the next row is appended."""
        return self._poses[self._end - self._window : self._end]

    @property
    def tracks(self) -> FloatArray:
        """The window's tracks (window, C); valid as long."""
        return self._tracks[self._end - self._window : self._end]

    @property
    def roots(self) -> FloatArray:
        """The window's roots (window, 3) in metres."""
        return self.tracks[:, :3]

    @property
    def lift(self) -> float:
        """How far the first pose is above the floor, metres."""
        return float(self._tracks[self._end - self._window, LIFT])

    @property
    def rest_heights(self) -> FloatArray:
        """Heights (S,) in metres of the soles' points at the first pose while they stand; (0,) for none."""
        heights: FloatArray = self._tracks[self._end - self._window, STANDING:NUMBER]
        return heights

    @property
    def number(self) -> int:
        """Number of the phrase that the first pose comes from."""
        return round(float(self._tracks[self._end - self._window, NUMBER]))

    @property
    def position_s(self) -> float:
        """Second in the phrase that the first pose comes from."""
        return float(self._tracks[self._end - self._window, AT])

    @property
    def standing(self) -> tuple[float, float, float]:
        """The root at the first pose: x, z in metres, heading in radians."""
        first = self._end - self._window
        x, z = self._tracks[first, [X, Z]].tolist()
        w, _, y, _ = self._poses[first, 0].tolist()
        return x, z, 2 * math.atan2(y, w)

    def _move_to_start(self) -> None:
        kept = self._window
        self._poses[:kept] = self._poses[-kept:]
        self._tracks[:kept] = self._tracks[-kept:]
        self._end = kept
