"""A smooth body for a skeleton of any kind: modelled, covered with a surface, tied to the joints."""

from __future__ import annotations

import numpy as np

from appliance.body.rest_pose import anatomy_of
from appliance.body.sculpture import Sculpture, sculpture
from appliance.body.skinning import BodyMesh, joint_numbers, weights_of
from appliance.body.surface import Finer, Grid, finer_grid, surface_of
from appliance.body.volumes import grid_around, sampled, settled
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

SPACING = 0.0086  # share of the height between samples; half of it where there are fingers, toes and a face
AROUND = 3  # cells around a detail that are small, too


def body_mesh(skeleton: Skeleton) -> BodyMesh:
    """The figure's surface, 30,000 to 40,000 triangles for a person; takes about a second, once."""
    anatomy = anatomy_of(skeleton)
    body = sculpture(anatomy)
    groups = (body.trunk, *body.limbs)
    grid = grid_around(groups, SPACING * anatomy.height)
    finer = [_finer(body, grid, box) for box in body.details]
    vertices, _, faces = surface_of(sampled(body.trunk, body.limbs, grid), grid, finer)
    places, slopes = settled(body.trunk, body.limbs, vertices.astype(np.float64), grid.spacing)
    vertices, normals = places.astype(np.float32), slopes.astype(np.float32)
    movers = [mover for group in groups for mover in group.movers]
    joints, weights = weights_of(vertices, faces, movers, anatomy.part_of)
    return BodyMesh(
        vertices,
        normals,
        faces,
        joint_numbers(joints, len(skeleton)),
        weights,
        anatomy.height,
        anatomy.positions.astype("float32"),
        anatomy.world.astype("float32"),
    )


def _finer(body: Sculpture, grid: Grid, box: tuple[Array, Array]) -> Finer:
    """The field in small cells in and around a box."""
    most = np.array(grid.shape) - 1
    low = np.clip(np.floor((box[0] - grid.origin) / grid.spacing).astype(np.int64) - AROUND, 0, most)
    high = np.clip(np.ceil((box[1] - grid.origin) / grid.spacing).astype(np.int64) + AROUND, 0, most)
    return Finer(low, sampled(body.trunk, body.limbs, finer_grid(grid, low, high)))
