"""Null networks: coders that know nothing of a dancer, danced beside the networks that an experiment asks.

A verdict that one of them passes as well says nothing about what a network has learned. They follow the loop
of iterative autoencoding: held joints are overwritten before the interaction iterations, and after the last
one where all are interactive.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.show.network import WINDOW
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.evaluation.coders import Poses

PULL = 0.3  # fraction of the way to the mean pose in each pass
LATENT = 32  # size of the untrained latent
SPREAD_DEGREES = 20.0  # spread of its output about the mean pose: as far as a dancer's joints go


class NullNetwork(ABC):
    """A coder of windows without a network. joints: names; mean (M, 4): the dancer's mean pose, heading
    removed.
    """

    batch, window = 512, WINDOW
    name = "none"

    def __init__(self, joints: Sequence[str], mean: Array) -> None:
        self.joints = tuple(joints)
        self.rest: Poses = quaternion.normalize(mean).astype(np.float32)
        self.facts = {"file": "none", "architecture": self.name, "precision": "none"}

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[NDArray[Any]] | None = None,
    ) -> tuple[Poses, Poses]:
        """Windows (B, 8, M, 4) after the last pass; the latents are zeros (B, 1)."""
        facing = quaternion.heading(windows[:, windows.shape[1] // 2, 0])[:, None]
        ahead = quaternion.inverse(facing)
        level = quaternion.aligned(_turned(windows, ahead), self.rest)
        held = np.zeros(0, np.intp) if hold is None else np.flatnonzero(hold.mask)
        if hold is not None:
            targets = _turned(np.broadcast_to(hold.targets, windows.shape), ahead)[:, :, held]
            weights = np.broadcast_to(hold.weights, windows.shape[2])[held]
        for number in range(coding_iterations + 1):
            last = number == coding_iterations
            if len(held) and interaction_iterations > number - last:
                level[:, :, held] = self.hold(level[:, :, held], targets, weights)
            if not last:
                level = self.code(level)
        return _turned(level, facing).astype(np.float32), np.zeros((len(windows), 1), np.float32)

    @abstractmethod
    def code(self, level: Poses) -> Poses:
        """One pass: windows (B, 8, M, 4) that face ahead -> the same, as a new array."""

    def hold(self, level: Poses, targets: Poses, weights: Poses) -> Poses:
        """Held joints (B, 8, H, 4) overwritten by their targets with weights (H,)."""
        towards = quaternion.slerp(level, targets, weights)
        return quaternion.aligned(towards, level).astype(np.float32)


class Paste(NullNetwork):
    """Copies every window with the held joints in it."""

    name = "paste"

    def code(self, level: Poses) -> Poses:
        return level.copy()


class Copy(Paste):
    """Copies every window, and hears no hand."""

    name = "copy"

    def hold(self, level: Poses, targets: Poses, weights: Poses) -> Poses:
        return level


class Mean(NullNetwork):
    """Pulls every joint a share of the way to the mean pose."""

    name = "mean"

    def __init__(self, joints: Sequence[str], mean: Array, pull: float = PULL) -> None:
        super().__init__(joints, mean)
        self._pull = pull

    def code(self, level: Poses) -> Poses:
        return _unit(level + self._pull * (self.rest - level))


class Untrained(NullNetwork):
    """Two dense layers with random weights about the mean pose, pose by pose.

    Every joint depends on every other one, and what comes out moves as far as a dancer: pose by pose,
    because a network over whole windows would be stilled by blending before it learns.
    """

    name = "untrained"

    def __init__(self, joints: Sequence[str], mean: Array, seed: int = 0) -> None:
        super().__init__(joints, mean)
        random, count = np.random.default_rng(seed), 4 * len(self.joints)
        spread = np.radians(SPREAD_DEGREES) / 2  # standard deviation of a quaternion's components
        self._encoder = random.normal(0, 1 / spread / np.sqrt(count), (count, LATENT)).astype(np.float32)
        self._decoder = random.normal(0, spread / np.sqrt(LATENT), (LATENT, count)).astype(np.float32)

    def code(self, level: Poses) -> Poses:
        away = (level - self.rest).reshape(*level.shape[:2], -1)
        latents = np.tanh(away @ self._encoder)
        return _unit(self.rest + (latents @ self._decoder).reshape(level.shape))


KINDS = (Copy, Paste, Mean, Untrained)


def null_networks(joints: Sequence[str], mean: Array) -> dict[str, NullNetwork]:
    """One of each of KINDS, by name."""
    return {kind.name: kind(joints, mean) for kind in KINDS}


def _turned(windows: Poses, turn: Poses) -> Poses:
    """Windows (B, 8, M, 4), the root joint turned by (B, 1, 4)."""
    turned = np.array(windows)
    turned[:, :, 0] = quaternion.multiply(np.broadcast_to(turn, windows[:, :, 0].shape), windows[:, :, 0])
    return turned


def _unit(level: Poses) -> Poses:
    level /= np.sqrt(np.einsum("...k,...k->...", level, level))[..., None]
    return level
