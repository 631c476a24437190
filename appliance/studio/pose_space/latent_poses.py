"""A phrase as a path of pose latents, and any path as poses: the pose autoencoder, one pose at a time.

A latent knows no heading and no place: both are taken out of the phrase and put back ('Beyond Imitation',
Figure 2: with them, the paths of a phrase would not be continuous).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from appliance.dancer.material.latent_paths import Latents
from appliance.pose.quaternion import Array
from appliance.studio.coded_windows import decoded, encoded
from appliance.studio.evaluation.coders import Poses

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network


def latents_of(network: Network, poses: Array) -> tuple[Latents, Array]:
    """Poses (T, M, 4) -> latents (T, Z) and headings (T, 4)."""
    return encoded(network, poses.astype(np.float32)[:, None])


def poses_of(network: Network, latents: Latents, facing: Array | None = None) -> Poses:
    """Latents (T, Z) -> poses (T, M, 4); facing (T, 4), left out: ahead."""
    made: Poses = decoded(network, latents, facing)[:, 0]
    return made


@dataclass(frozen=True)
class PoseMap:
    """Orthogonal directions (D, Z) of the latents along which the body differs most, and their middle (Z,).

    A point of the map is in latent units from the middle. explained: share of the figures' variance along
    these directions.
    """

    middle: Array
    directions: Array
    explained: float

    @staticmethod
    def of(latents: Latents, figures: Array, dimensions: int) -> PoseMap:
        """latents (N, Z) of figures (N, P): where all numbers of a latent vary alike, as the prior wants them
        to, only the figures say which directions matter. Given as their own figures: principal components.
        """
        values, shapes = (each - each.mean(axis=0) for each in (latents.astype(np.float64), figures))
        effect = np.linalg.lstsq(values, shapes, rcond=None)[0]
        directions = np.linalg.svd(effect * values.std(axis=0)[:, None], full_matrices=False)[0].T[
            :dimensions
        ]
        signs = np.sign(directions[np.arange(len(directions)), np.abs(directions).argmax(axis=1)])
        return PoseMap.along(
            latents, figures, latents.astype(np.float64).mean(axis=0), signs[:, None] * directions
        )

    @staticmethod
    def along(latents: Latents, figures: Array, middle: Array, directions: Array) -> PoseMap:
        """A map whose middle (Z,) and directions (D, Z) are known, such as a show's."""
        values, shapes = (each - each.mean(axis=0) for each in (latents.astype(np.float64), figures))
        seen = values @ directions.T
        left = shapes - seen @ np.linalg.lstsq(seen, shapes, rcond=None)[0]
        explained = 1 - float(left.var(axis=0).sum() / max(float(shapes.var(axis=0).sum()), 1e-12))
        return PoseMap(middle, directions, explained)

    def points(self, latents: Latents) -> Array:
        """(T, Z) -> (T, D)."""
        found: Array = (latents - self.middle) @ self.directions.T
        return found

    def latents(self, points: Array) -> Latents:
        """(T, D) -> (T, Z): the pose that is usual there."""
        back: Latents = (self.middle + points @ self.directions[: points.shape[1]]).astype(np.float32)
        return back


def distance_over_time(one: Array, other: Array) -> Array:
    """(T,): how far apart two paths of points (T, D) are at each tick."""
    count = min(len(one), len(other))
    apart: Array = np.linalg.norm(one[:count] - other[:count], axis=1)
    return apart
