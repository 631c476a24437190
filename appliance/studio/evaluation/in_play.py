"""A phrase danced as in play: the box's own hands and blending around a coder, a window every tick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.blending import Blending
from appliance.dancer.hands import Hands
from appliance.dancer.puppeteers import TAKE_S, Puppeteer
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, WINDOW
from appliance.studio.evaluation.coders import Coder, Poses

TICK_S = 1 / FPS
TAKING_TICKS = round((TAKE_S + 0.5) * FPS)  # before the dance begins: the hand then has its joint for good


class FollowedOrientation(Puppeteer):
    """Holds its joint at orientations (N, 4), one a tick from time 0; before and after, the outermost."""

    def __init__(self, joint: str, orientations: Array) -> None:
        super().__init__(joint)
        self._orientations = quaternion.continuous(orientations).astype(np.float32)
        self._target.orientation[:] = self._orientations[0]

    def _point(self, orientation: NDArray[np.float32], now: float, elapsed: float) -> None:
        tick = min(max(round(now / TICK_S), 0), len(self._orientations) - 1)
        orientation[:] = self._orientations[tick]


class Rehearsal:
    """One phrase and one coder: dances with and without a hand, from the tick on that 8 windows overlap.

    windows (T + 7, 8, M, 4): what is coded, one a tick. phrase (T, M, 4): what is danced where no network is
    in between; recording: the same ticks with all joints.
    """

    def __init__(self, coder: Coder, recording: Recording) -> None:
        self.coder = coder
        self.places = [recording.skeleton.index(name) for name in coder.joints]
        poses = quaternion.continuous(recording.poses[:, self.places]).astype(np.float32)
        count = max(0, len(poses) - WINDOW + 1)
        self.windows: Poses = poses[np.arange(count)[:, None] + np.arange(WINDOW)]
        self.phrase = poses[WINDOW - 1 : count]
        self.recording = recording.excerpt((WINDOW - 1) / recording.fps, count / recording.fps)
        self._free: dict[int, Poses] = {}

    def free(self, coding_iterations: int) -> Poses:
        """(T, M, 4): the dance without a hand; each is danced once."""
        if coding_iterations not in self._free:
            self._free[coding_iterations] = self._danced(self.windows, coding_iterations)
        return self._free[coding_iterations]

    def held(
        self, coding_iterations: int, interaction_iterations: int, hand: Puppeteer, part: slice = slice(None)
    ) -> tuple[Poses, Poses]:
        """The dance (T, M, 4) with a hand, and where the hand was (T, 4).

        part: of the windows; the hand's time begins with its first one, the dance 7 ticks later.
        """
        windows = self.windows[part]
        hands = Hands([hand], self.coder.joints)
        targets, shown = np.empty_like(windows), np.empty((len(windows), 4), dtype=np.float32)
        for tick in range(-TAKING_TICKS, len(windows)):
            row, now = max(tick, 0), tick * TICK_S
            hands.pull(now, windows[row])
            targets[row] = hands.targets
            shown[row] = hand.pull(now).orientation
        danced = self._danced(
            windows, coding_iterations, interaction_iterations, hands.mask, targets, hands.weights
        )
        return danced, shown[WINDOW - 1 :]

    def whole(self, danced: Poses) -> Array:
        """(T, J, 4): a dance with the joints that the network does not move, as the phrase has them."""
        poses = self.recording.poses[: len(danced)].copy()
        poses[:, self.places] = danced
        return poses

    def _danced(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        mask: NDArray[np.bool_] | None = None,
        targets: Poses | None = None,
        weights: NDArray[np.float32] | None = None,
    ) -> Poses:
        """Every window coded: nothing feeds back, so all of them can be coded before they are blended."""
        made = []
        for first in range(0, len(windows), self.coder.batch):
            part = slice(first, first + self.coder.batch)
            aims = None if targets is None else targets[part]
            poses, _ = self.coder.iterate(
                windows[part], coding_iterations, interaction_iterations, mask, aims, weights
            )
            made.append(poses)
        return blended(np.concatenate(made))


def blended(windows: Poses) -> Poses:
    """Windows (T + 7, 8, M, 4), one a tick, as the endless motion (T, M, 4) that the box makes of them."""
    blending = Blending(windows.shape[2], windows.shape[1])
    danced = np.empty((len(windows), *windows.shape[2:]), dtype=np.float32)
    for tick, window in enumerate(windows):
        blending.add(window)
        danced[tick] = blending.take()
    return danced[windows.shape[1] - 1 :]
