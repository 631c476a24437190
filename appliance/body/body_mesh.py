"""A smooth body for a skeleton of any kind: modelled, covered with a surface, tied to the joints."""

from __future__ import annotations

from appliance.body.rest_pose import anatomy_of
from appliance.body.sculpture import sculpture
from appliance.body.skinning import BodyMesh, weights_of
from appliance.body.surface import surface_of
from appliance.body.volumes import sampled
from appliance.pose.skeleton import Skeleton

SPACING = 0.0065  # share of the height between samples: about 14,000 vertices for a figure with fingers


def body_mesh(skeleton: Skeleton) -> BodyMesh:
    """The figure's surface; takes a good half second, once."""
    anatomy = anatomy_of(skeleton)
    trunk, limbs = sculpture(anatomy)
    field, grid = sampled(trunk, limbs, SPACING * anatomy.height)
    vertices, normals, faces = surface_of(field, grid)
    movers = [mover for group in (trunk, *limbs) for mover in group.movers]
    joints, weights = weights_of(vertices, faces, movers, anatomy.part_of)
    return BodyMesh(
        vertices,
        normals,
        faces,
        joints,
        weights,
        anatomy.height,
        anatomy.positions.astype("float32"),
        anatomy.world.astype("float32"),
    )
