"""The ground of a dancer's map: all recorded poses, and the figures that are usual at each place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from appliance.dancer.material.map_reach import MapReach
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import Dataset
from appliance.studio.pose_space import map_pictures
from appliance.studio.pose_space.latent_poses import PoseMap, latents_of, poses_of
from appliance.studio.pose_space.pose_model import training_poses

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network

EDGE = 1.0  # percent of the recorded poses that lie outside of the map on each side
GRID = 9  # figures along the map's wider side
NOBODY = 0.35  # fraction of the map's spread: farther from all recorded poses nobody has been


@dataclass(frozen=True)
class Ground:
    """pose_map: of a model, in three dimensions; known (N, 3): its points of the training poses."""

    network: Network
    dataset: Dataset
    pose_map: PoseMap
    known: Array

    @staticmethod
    def of(network: Network, dataset: Dataset) -> Ground:
        latents, figures = training_poses(network, dataset)
        if isinstance(network, MotionNetwork) and network.ground is not None:
            pose_map = PoseMap.along(latents, figures, *network.ground[:2])  # as on stage
        else:
            pose_map = PoseMap.of(latents, figures, 3)
        return Ground(network, dataset, pose_map, pose_map.points(latents))

    def path(self, poses: Array) -> Array:
        """Points (T, D) of poses (T, M, 4)."""
        return self.pose_map.points(latents_of(self.network, poses)[0])

    @cached_property
    def reach(self) -> MapReach:
        """How far the map leads that is drawn, and that a show gets."""
        low, high = self._edges
        moving = list(self.dataset.moving)
        danced = [take.recording.poses[take.sound][:, moving] for take in self.dataset.training]

        def poses_at(points: Array) -> Array:
            return poses_of(self.network, self.pose_map.latents(points))

        return MapReach.of(low, high, poses_at, np.concatenate(danced))

    @property
    def _edges(self) -> tuple[Array, Array]:
        """Low and high (2,): of a show as on stage, else of the recorded poses."""
        if isinstance(self.network, MotionNetwork) and self.network.ground is not None:
            return self.network.ground[2:]
        low, high = np.percentile(self.known[:, :2], [EDGE, 100 - EDGE], axis=0)
        return low, high

    def draw(
        self, file: Path, paths: Mapping[str, Array], marks: Array | None = None
    ) -> tuple[float, float, float, float]:
        """Paths and numbered marks over the map's first two directions; its left, right, bottom and top."""
        return map_pictures.draw_map(file, self.known, paths, self._figures(), NOBODY, marks)

    def _figures(self) -> list[tuple[Array, Array, Sequence[tuple[int, int]]]]:
        """On a grid: place (2,), the figure that is usual there (J, 3) in metres, its bones."""
        skeleton = self.dataset.skeleton
        low, high = self._edges
        step = float((high - low).max()) / (GRID - 1)
        columns, rows = (np.arange(a, b + step / 2, step) for a, b in zip(low, high, strict=True))
        places = np.array([(x, y) for y in rows for x in columns])
        whole = np.tile(self.dataset.still_pose(), (len(places), 1, 1))
        whole[:, list(self.dataset.moving)] = poses_of(self.network, self.pose_map.latents(places))
        positions, _ = skeleton.forward_kinematics(whole, np.zeros((len(places), 3)))
        bones = [(joint, parent) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
        return [(place, figure, bones) for place, figure in zip(places, positions, strict=True)]
