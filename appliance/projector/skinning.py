"""Skinning: the surface follows the joints, by dual quaternions, so that twisted limbs keep their volume.

A dual quaternion is 8 numbers: a rotation r (w, x, y, z) and a dual part d = 0.5 * t * r, where t is the
translation as a quaternion without a real part (Kavan et al. 2007, Skinning with Dual Quaternions). A
shader does the same as `skin`: take the four (r, d) of a vertex, turn those whose r points away from the
first one's, sum with the weights, divide both by the length of r; then a point p becomes
p + 2 * cross(r.xyz, cross(r.xyz, p) + r.w * p) + 2 * (r.w * d.xyz - d.w * r.xyz + cross(r.xyz, d.xyz)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.projector.volumes import Slab


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """A closed surface around a skeleton, in the pose in which it was modelled.

    vertices, normals: (V, 3) float32, metres; faces: (F, 3) int32, counter-clockwise seen from outside;
    joints: (V, 4) uint8 and weights: (V, 4) float32, which joints move a vertex, sum 1, strongest first;
    height: metres; bind_positions: (J, 3) and bind_world: (J, 4), where the joints were when it was modelled.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int32]
    joints: NDArray[np.uint8]
    weights: NDArray[np.float32]
    height: float
    bind_positions: NDArray[np.float32]
    bind_world: NDArray[np.float32]


def dual_quaternions(mesh: BodyMesh, positions: Array, world: Array) -> NDArray[np.float32]:
    """(J, 8) float32, r then d: from the pose in which the mesh was modelled to positions (J, 3) in metres
    and world rotations (J, 4)."""
    turn = quaternion.multiply(np.asarray(world), quaternion.inverse(mesh.bind_world))
    shift = np.zeros((len(turn), 4))
    shift[:, 1:] = positions - quaternion.rotate(turn, mesh.bind_positions)
    return np.concatenate([turn, 0.5 * quaternion.multiply(shift, turn)], axis=1).astype(np.float32)


def skin(mesh: BodyMesh, positions: Array, world: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Vertices and normals (V, 3) for positions (J, 3) in metres and world rotations (J, 4)."""
    moved_by = dual_quaternions(mesh, positions, world)[mesh.joints]  # (V, 4, 8)
    agrees = np.sum(moved_by[..., :4] * moved_by[:, :1, :4], axis=-1) >= 0.0
    blended = np.einsum("vk,vkc->vc", np.where(agrees, mesh.weights, -mesh.weights), moved_by)
    blended /= np.linalg.norm(blended[:, :4], axis=1, keepdims=True)
    turn, dual = blended[:, :4], blended[:, 4:]
    shift = 2.0 * quaternion.multiply(dual, quaternion.inverse(turn))[:, 1:]
    vertices = quaternion.rotate(turn, mesh.vertices) + shift
    return vertices.astype(np.float32), quaternion.rotate(turn, mesh.normals).astype(np.float32)


SPREAD_STEPS = 18  # how often weights flow to the neighbours on the surface
MOVERS = 4


def weights_of(
    vertices: NDArray[np.float32], faces: NDArray[np.int32], slabs: Sequence[Slab], joints: int
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Which joints move each vertex, (V, 4), and how much, (V, 4): those whose volume is nearest, softened
    along the surface alone, so that an arm at the hip is not moved by the hip."""
    owners = sorted({slab.owner for slab in slabs})
    place = {owner: number for number, owner in enumerate(owners)}
    away = np.full((len(vertices), len(owners)), np.inf, dtype=np.float32)
    x, y, z = vertices.T
    for slab in slabs:
        column = away[:, place[slab.owner]]
        np.minimum(column, slab.distance(x, y, z), out=column)
    weights = np.zeros_like(away)
    weights[np.arange(len(away)), away.argmin(axis=1)] = 1.0
    weights = _spread_along(faces, weights)
    strongest = np.argsort(-weights, axis=1, kind="stable")[:, :MOVERS]
    kept = np.take_along_axis(weights, strongest, axis=1)
    kept /= kept.sum(axis=1, keepdims=True)
    missing = MOVERS - kept.shape[1]
    movers = np.pad(np.array(owners)[strongest], ((0, 0), (0, max(missing, 0))), mode="edge")
    return movers.astype(np.uint8), np.pad(kept, ((0, 0), (0, max(missing, 0)))).astype(np.float32)


def _spread_along(faces: NDArray[np.int32], weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean with the neighbours on the surface, some times over."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])  # each both ways: closed
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    counts = np.bincount(edges[:, 0], minlength=len(weights))
    begins = np.concatenate([[0], np.cumsum(counts)[:-1]])
    for _ in range(SPREAD_STEPS):
        around = np.add.reduceat(weights[edges[:, 1]], begins, axis=0) / counts[:, None]
        weights = (0.5 * (weights + around)).astype(np.float32)
    return weights
