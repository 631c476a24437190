"""Step memory: what a figure has just danced, as the steps that an improviser reads."""

from __future__ import annotations

import math

import numpy as np

from appliance.dancer.material.steps import HOP, MIDDLE, ROOT, WINDOW, Coder
from appliance.dancer.slerp import FloatArray

CAPACITY = 44  # steps, 3.5 s: as late as an answer may be, and what it sees before that
WAITING = (
    8  # steps that wait for the encoder at most; in the tick a run of many costs hardly more than of one
)
AGE = WINDOW - MIDDLE  # ticks from a step's middle to the first tick that knows the step


class StepMemory:
    """Watches a figure once a tick. The encoder runs when steps are read, for all that are new, or where
    WAITING of them are.

    steps (44, F): features, the newest last; known: how many of them are danced. place: x, z (metres) and
    heading (radians) at the middle of the newest step; age: ticks since then.
    """

    SNAPSHOT = ("_poses", "_roots", "_ticks", "_waiting", "steps", "known", "place")

    def __init__(self, coder: Coder, places: list[int], phase: int = 0) -> None:
        """places: joints of the skeleton that the coder sees; phase 0..3: which ticks pay."""
        self._coder, self._places = coder, places
        self._poses = np.zeros((WINDOW + HOP * WAITING - 1, len(places), 4), np.float32)
        self._poses[..., 0] = 1.0
        self._roots = np.zeros((WINDOW, 3), np.float32)
        self.steps = np.zeros((CAPACITY, coder.latent + ROOT), np.float32)
        self._ticks, self._waiting, self.known = phase - HOP, 0, 0
        self.place = np.zeros(3)

    @property
    def age(self) -> int:
        """Ticks from the middle of the newest step to the pose watched last."""
        return AGE - 1 + self._ticks % HOP

    def watch(self, pose: FloatArray, root: FloatArray) -> None:
        """A pose (J, 4) with its root (3,) in metres above the floor."""
        self._poses[:-1], self._roots[:-1] = self._poses[1:], self._roots[1:]
        self._poses[-1], self._roots[-1] = pose[self._places], root
        self._ticks += 1
        if self._ticks % HOP or self._ticks < WINDOW:
            return
        w, _, y, _ = self._poses[MIDDLE - WINDOW, 0].tolist()
        x, height, z = self._roots[MIDDLE].tolist()
        heading = 2 * math.atan2(y, w)
        from_x, from_z, before = self.place.tolist()
        cosine, sine = math.cos(before), math.sin(before)
        dx, dz = x - from_x, z - from_z
        self.steps[:-1] = self.steps[1:]
        turn = math.remainder(heading - before, math.tau)
        self.steps[-1, -ROOT:] = cosine * dx - sine * dz, cosine * dz + sine * dx, turn, height
        self.place[:] = x, z, heading
        self.known = min(self.known + 1, CAPACITY)
        self._waiting += 1
        if self._waiting == WAITING:
            self._encode()

    def recent(self, count: int, ago: int = 0) -> FloatArray | None:
        """Steps (count, F) that ended so many steps ago; None: not all of them are danced."""
        if count + ago >= self.known:
            return None
        self._encode()
        end = CAPACITY - ago
        return self.steps[end - count : end]

    def _encode(self) -> None:
        """Latents of the steps that wait; since the newest of them up to three poses have come."""
        if not self._waiting:
            return
        ends = len(self._poses) - self._ticks % HOP - HOP * np.arange(self._waiting)[::-1]
        latents, _ = self._coder.encode(self._poses[ends[:, None] + np.arange(-WINDOW, 0)])
        self.steps[-self._waiting :, :-ROOT] = latents
        self._waiting = 0
