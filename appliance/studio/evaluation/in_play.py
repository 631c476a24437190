"""A phrase danced as on stage: the box's own hands and blending around a coder, a window every tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.blending import Blending, Shape
from appliance.dancer.hands import Hands
from appliance.dancer.puppet import weights_of_one_pass
from appliance.dancer.puppeteers import TAKE_S, Puppeteer
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.data.dataset import FPS, WINDOW
from appliance.studio.evaluation.coders import Coder, Poses

TICK_S = 1 / FPS
TAKING_TICKS = round((TAKE_S + 0.5) * FPS)  # before the dance: the hand has then fully taken its joint


class FollowedOrientation(Puppeteer):
    """Holds its joint at orientations (N, 4), one each tick from time 0; clamped at both ends."""

    def __init__(self, joint: str, orientations: Array) -> None:
        super().__init__(joint)
        self._orientations = quaternion.continuous(orientations).astype(np.float32)
        self._target.orientation[:] = self._orientations[0]

    def _point(self, orientation: NDArray[np.float32], now: float, elapsed: float) -> None:
        tick = min(max(round(now / TICK_S), 0), len(self._orientations) - 1)
        orientation[:] = self._orientations[tick]


class Rehearsal:
    """One phrase and one coder: dances with and without a hand, from the tick at which 8 windows overlap.

    windows (T + 7, 8, M, 4): what is coded, one each tick. phrase (T, M, 4): the same ticks as recorded;
    recording: with all joints.
    """

    def __init__(self, coder: Coder, recording: Recording, shape: Shape = "prompt") -> None:
        self.coder, self._shape = coder, shape
        self.places = [recording.skeleton.index(name) for name in coder.joints]
        poses = quaternion.continuous(recording.poses[:, self.places]).astype(np.float32)
        count = max(0, len(poses) - WINDOW + 1)
        self.windows: Poses = poses[np.arange(count)[:, None] + np.arange(WINDOW)]
        self.phrase = poses[WINDOW - 1 : count]
        self.recording = recording.excerpt((WINDOW - 1) / recording.fps, count / recording.fps)
        self._free: dict[int, Poses] = {}

    def free(self, coding_iterations: int) -> Poses:
        """(T, M, 4): the dance without a hand; computed once for each count."""
        if coding_iterations not in self._free:
            self._free[coding_iterations] = self._danced(self.windows, coding_iterations)
        return self._free[coding_iterations]

    def held(
        self,
        coding_iterations: int,
        interaction_iterations: int,
        hand: Puppeteer,
        part: slice = slice(None),
        others: Sequence[Puppeteer] = (),
    ) -> tuple[Poses, Poses]:
        """The dance (T, M, 4) with a hand, and where the hand was (T, 4).

        part: which windows; the hand's time begins with the first of them, the dance 7 ticks later.
        others: more hands, on other joints.
        """
        windows = self.windows[part]
        hands = Hands([hand, *others], self.coder.joints)
        targets, shown = np.empty_like(windows), np.empty((len(windows), 4), dtype=np.float32)
        for tick in range(-TAKING_TICKS, len(windows)):
            row, now = max(tick, 0), tick * TICK_S
            hands.pull(now, windows[row])
            targets[row] = hands.targets
            shown[row] = hand.pull(now).orientation
        hold: HeldJoints[NDArray[Any]] = HeldJoints(
            hands.mask, targets, weights_of_one_pass(hands.weights, interaction_iterations)
        )
        return self._danced(windows, coding_iterations, interaction_iterations, hold), shown[WINDOW - 1 :]

    def whole(self, danced: Poses) -> Array:
        """(T, J, 4): a dance completed with the phrase's joints that the network does not move."""
        poses = self.recording.poses[: len(danced)].copy()
        poses[:, self.places] = danced
        return poses

    def _danced(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[NDArray[Any]] | None = None,
    ) -> Poses:
        """Code all windows, then blend them: nothing feeds back from one to the next."""
        coded = []
        for first in range(0, len(windows), self.coder.batch):
            part = slice(first, first + self.coder.batch)
            held = None if hold is None else hold._replace(targets=hold.targets[part])
            coded.append(
                self.coder.iterate(windows[part], coding_iterations, interaction_iterations, held)[0]
            )
        return blended(np.concatenate(coded), self._shape)


def blended(windows: Poses, shape: Shape = "prompt") -> Poses:
    """Windows (T + 7, 8, M, 4), one each tick, blended into motion (T, M, 4) as the box does it."""
    blending = Blending(windows.shape[2], windows.shape[1], shape=shape)
    danced = np.empty((len(windows), *windows.shape[2:]), dtype=np.float32)
    for tick, window in enumerate(windows):
        blending.add(window)
        danced[tick] = blending.take()
    return danced[windows.shape[1] - 1 :]
