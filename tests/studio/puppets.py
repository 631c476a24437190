"""Coders that dance in a known way: what a figure of the answer must tell apart."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.evaluation.coders import Poses
from tests.studio.tiny import moving, skeleton

NAMES = tuple(skeleton().names[j] for j in moving())


class Pasting:
    """Copies the window and pastes the held joints on: the useless product."""

    batch = 64

    def __init__(self, joints: tuple[str, ...] = NAMES) -> None:
        self.joints, self.facts = joints, {"file": "pasting", "architecture": "none", "precision": "exact"}
        self.rest = np.tile(quaternion.IDENTITY, (len(joints), 1))

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[NDArray[Any]] | None = None,
    ) -> tuple[Poses, Poses]:
        made = windows.copy()
        if hold is not None and interaction_iterations:
            made[:, :, hold.mask] = quaternion.aligned(hold.targets, windows)[:, :, hold.mask]
            made = self.answer(made, hold.mask)
        return made, np.zeros((len(windows), 4), dtype=np.float32)

    def answer(self, made: Poses, mask: NDArray[np.bool_]) -> Poses:
        """What the other joints do with the held ones in place."""
        return made


class Turning(Pasting):
    """Every other joint turns along with the held one: an answer, though no dancer's."""

    def answer(self, made: Poses, mask: NDArray[np.bool_]) -> Poses:
        held = made[:, :, mask][:, :, :1]
        made[:, :, ~mask] = quaternion.multiply(held, made[:, :, ~mask])
        return made


class Remembering(Pasting):
    """Does what the dancer did when the held joints were most like this: the best fit there is."""

    def __init__(self, poses: NDArray[np.floating]) -> None:
        super().__init__()
        self._poses = poses.astype(np.float32)

    def answer(self, made: Poses, mask: NDArray[np.bool_]) -> Poses:
        cosines = np.abs(np.einsum("bthk,nhk->btnh", made[:, :, mask], self._poses[:, mask])).sum(axis=-1)
        return quaternion.aligned(self._poses[cosines.argmax(axis=-1)], made).astype(np.float32)


class Freezing(Pasting):
    """The others stand still where they rest."""

    def answer(self, made: Poses, mask: NDArray[np.bool_]) -> Poses:
        made[:, :, ~mask] = self.rest[~mask]
        return made
