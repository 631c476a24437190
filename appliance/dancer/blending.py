"""Blending: overlapping windows of 8 poses become endless motion by SLERP onto the running pose.

Each generated window lies over the running motion of the next 8 ticks. A pose that the window meets there
moves towards it by SLERP with the share weight / (weight gathered so far + weight), so that after all windows
have passed it is their weighted mean. The weights decide what this costs in latency: a step of the target
reaches the output with the windows that are generated after it. At hop 1 its share in the pose of the same
tick, and after 1, 2, ... 7 more ticks, is

    prompt  33 %   61 %   81 %   93 %   98 %  100 %  100 %  100 %
    hann     1 %    9 %   26 %   50 %   74 %   91 %   99 %  100 %

Hann is the papers' (Granular Dance): half of a step 60 ms later. Prompt gives the present pose of the newest
window the most, and the next ones less by the fourth power of a cosine: half of a step within 20 ms. Measured
on salsa_29 with hands of salsa_24 on upper arms, head and forearm at 10/9: prompt keeps 0.87 to 1.06 of the
phrase's energy around the hand (hann 0.82 to 1.01). Its roughness is 0.87 to 1.07 of the phrase's (hann 0.73
to 0.95); the present pose without any blending would be 1.4 to 1.7 times as rough as the phrase.

A larger hop adds up to hop - 1 ticks of waiting for the next window; prompt then fades each in over them.
From hop 5 on some poses are seen by one window only, and at hop 8 all of them: no blending is left.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from appliance.dancer.slerp import FloatArray, Slerp

Shape = Literal["prompt", "hann"]

_ROWS = 256  # poses of running motion in memory; at its end they move back to the start


class Blending:
    """A running buffer of the next `window` poses of `joints` joints; a window arrives every `hop` ticks."""

    SNAPSHOT = ("_running", "_gathered_here", "hop", "_ticks_since_window", "_fresh")

    def __init__(self, joints: int, window: int = 8, hop: int = 1, shape: Shape = "prompt") -> None:
        self._window, self._joints, self._shape = window, joints, shape
        self._weights = np.empty(window * joints, dtype=np.float32)
        self.hop = hop
        self._poses = np.zeros((_ROWS, joints, 4), dtype=np.float32)
        self._poses[..., 0] = 1.0
        self._gathered = np.zeros((_ROWS, joints), dtype=np.float32)
        self._share = np.empty(window * joints, dtype=np.float32)
        self._slerp = Slerp(window * joints)
        self._first = 0
        self._ticks_since_window = 0
        self._fresh = True

    @property
    def hop(self) -> int:
        """Ticks from one generated window to the next, 1..window."""
        return self._hop

    @hop.setter
    def hop(self, ticks: int) -> None:
        if not 1 <= ticks <= self._window:
            raise ValueError(f"hop is {ticks}; a window of {self._window} poses allows 1 to {self._window}.")
        self._hop = ticks
        counted = weights(self._window, ticks, self._shape)
        self._weights[:] = np.repeat(counted, self._joints)
        self._shares: FloatArray = counted / counted.sum()

    @property
    def shares(self) -> FloatArray:
        """(window,): how much of a blended pose comes from each pose of a window; their sum is 1."""
        return self._shares

    @property
    def ahead(self) -> float:
        """Ticks from the start of a window to what is used of it on average."""
        return float(self._shares @ np.arange(self._window))

    @property
    def is_due(self) -> bool:
        """Whether a window should be generated in this tick."""
        return self._fresh or self._ticks_since_window >= self._hop

    def add(self, poses: FloatArray) -> None:
        """Blend a generated window (window, joints, 4) of unit quaternions into the motion from now on."""
        running, gathered = self._running.reshape(-1, 4), self._gathered_here.reshape(-1)
        np.add(gathered, self._weights, out=gathered)
        np.divide(self._weights, gathered, out=self._share)
        self._slerp(running, poses.reshape(-1, 4), self._share, out=running)
        self._ticks_since_window = 0
        self._fresh = False

    def take(self) -> FloatArray:
        """The pose (joints, 4) of this tick; it stays valid until the next call.

        Without new windows the motion runs out after `window` ticks and the last pose is held.
        """
        pose: FloatArray = self._poses[self._first]
        self._first += 1
        self._ticks_since_window += 1
        last = self._first + self._window - 1
        if last == _ROWS:
            self._move_to_start()
            last = self._window - 1
        # A new pose starts as its neighbour with nothing gathered: the first window that meets it replaces
        # it, in the neighbour's hemisphere, so that no sign ever jumps.
        self._poses[last] = self._poses[last - 1]
        self._gathered[last] = 0.0
        return pose

    @property
    def _rows(self) -> slice:
        return slice(self._first, self._first + self._window)

    @property
    def _running(self) -> FloatArray:
        """The running motion from this tick on, in place."""
        return self._poses[self._rows]

    @property
    def _gathered_here(self) -> FloatArray:
        return self._gathered[self._rows]

    def _move_to_start(self) -> None:
        kept = self._window - 1
        self._poses[:kept] = self._poses[-kept:]
        self._gathered[:kept] = self._gathered[-kept:]
        self._first = 0


def weights(window: int, hop: int, shape: Shape) -> FloatArray:
    """(window,): how much each pose of a window counts, the present one first."""
    place = np.arange(window) + 0.5
    if shape == "hann":
        counted = np.sin(np.pi * place / window) ** 2
    else:
        rise = hop - 1
        rising = np.sin(np.pi / 2 * place / max(rise, 1)) ** 2
        counted = np.where(place < rise, rising, np.cos(np.pi / 2 * (place - rise) / (window - rise)) ** 4)
    return counted.astype(np.float32)
