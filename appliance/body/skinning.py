"""Skinning: the surface follows the joints, by dual quaternions, so that twisted limbs keep their volume.

A dual quaternion is 8 numbers: a rotation r (w, x, y, z) and a dual part d = 0.5 * t * r, where t is the
translation as a quaternion without a real part (Kavan et al. 2007, Skinning with Dual Quaternions). The
vertex shaders (skin.glsl) take the four (r, d) of a vertex, turn those whose r points away from the first
one's, sum with the weights, and divide both by the length of r; then a point p becomes
p + 2 * cross(r.xyz, cross(r.xyz, p) + r.w * p) + 2 * (r.w * d.xyz - d.w * r.xyz + cross(r.xyz, d.xyz)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.body.volumes import Ball, Slab
from appliance.pose import quaternion
from appliance.pose.quaternion import Array

JointNumbers = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Baked:
    """A surface is drawn with these, too; `bake.bake` computes them.

    open: (V,) float32, 0 to 1, how much of the light from all around reaches a vertex; sunk: (V, 3), figure
    heights, how far a vertex moves where the face turns smooth, and calm: (V, 3) float32, its normal there;
    order: (F,), the faces in the order in which they are drawn.
    """

    open: NDArray[np.float32]
    sunk: NDArray[np.floating]
    calm: NDArray[np.float32]
    order: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """A closed surface around a skeleton, in the pose in which it was modelled.

    vertices, normals: (V, 3) float32, metres; faces: (F, 3) int32, counter-clockwise seen from outside;
    joints: (V, 4) as joint_numbers and weights: (V, 4) float32, which joints move a vertex, sum 1, strongest
    first;
    height: metres; bind_positions: (J, 3) and bind_world: (J, 4), where the joints were when it was modelled;
    baked: in a surface that was read from a show.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int32]
    joints: JointNumbers
    weights: NDArray[np.float32]
    height: float
    bind_positions: NDArray[np.float32]
    bind_world: NDArray[np.float32]
    baked: Baked | None = None


def joint_numbers(joints: NDArray[np.integer], count: int) -> JointNumbers:
    """Numbers of a skeleton's joints as a surface has them: in a byte, of more than 256 joints in two."""
    return joints.astype(np.uint8) if count <= 256 else joints.astype(np.uint16)


def dual_quaternions(bind_positions: Array, bind_world: Array, positions: Array, world: Array) -> Array:
    """(..., J, 8), r then d: from the pose in which a mesh was modelled to positions (..., J, 3) and world
    rotations (..., J, 4)."""
    turn = quaternion.multiply(np.asarray(world), quaternion.inverse(bind_world))
    shift = np.zeros_like(turn)
    shift[..., 1:] = positions - quaternion.rotate(turn, bind_positions)
    return np.concatenate([turn, 0.5 * quaternion.multiply(shift, turn)], axis=-1)


MOVERS = 4  # joints that move a vertex
FAR_STEPS, NEAR_STEPS = 44, 8  # how often weights flow to the neighbours: between limbs, between fingers


def weights_of(
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    volumes: Sequence[Slab | Ball],
    part_of: Callable[[int], int],
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Which joints move each vertex, (V, 4), and how much, (V, 4), strongest first.

    The owner of the nearest volume, softened only along the surface: a hanging hand does not move the thigh
    next to it. Softened far between the parts of the body, little within a part (hand and fingers).
    """
    owners = sorted({volume.owner for volume in volumes})
    place = {owner: number for number, owner in enumerate(owners)}
    away = np.full((len(vertices), len(owners)), np.inf, dtype=np.float32)
    x, y, z = vertices.T
    for volume in volumes:
        column = away[:, place[volume.owner]]
        np.minimum(column, volume.distance(x, y, z), out=column)
    nearest = away.argmin(axis=1)
    around = neighbours(faces, len(vertices))
    parts = np.array([part_of(owner) for owner in owners])
    names, part = np.unique(parts, return_inverse=True)
    share = _spread(np.eye(len(names), dtype=np.float32)[part[nearest]], around, FAR_STEPS)
    within = _spread(np.eye(len(owners), dtype=np.float32)[nearest], around, NEAR_STEPS)
    weights = _divided(share, within, part)
    weights = np.pad(weights, ((0, 0), (0, max(0, MOVERS - len(owners)))))
    few = np.argpartition(weights, -MOVERS, axis=1)[:, -MOVERS:]
    order = np.argsort(-np.take_along_axis(weights, few, axis=1), axis=1, kind="stable")
    strongest = np.take_along_axis(few, order, axis=1)
    kept = np.take_along_axis(weights, strongest, axis=1)
    joints = np.array([*owners, *owners[:1] * MOVERS])[strongest]
    return joints, (kept / kept.sum(axis=1, keepdims=True)).astype(np.float32)


def neighbours(faces: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """(most, V): the vertices with which each shares an edge, then itself."""
    edges = np.concatenate([faces[:, [a, (a + 1) % 3]] for a in range(3)])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    first = np.searchsorted(edges[:, 0], np.arange(count + 1))
    around = np.tile(np.arange(count), (int(np.diff(first).max()), 1))
    around[np.arange(len(edges)) - first[edges[:, 0]], edges[:, 0]] = edges[:, 1]
    return around


def _divided(
    share: NDArray[np.float32], within: NDArray[np.float32], part: NDArray[np.intp]
) -> NDArray[np.float32]:
    """The parts' shares (V, P) for their joints (V, C) as `within` says; else for their first joint."""
    weights = np.zeros_like(within)
    for number in range(share.shape[1]):
        columns = np.flatnonzero(part == number)
        own = within[:, columns]
        total = own.sum(axis=1, keepdims=True)
        first = np.eye(1, len(columns), dtype=np.float32)
        weights[:, columns] = share[:, [number]] * np.where(
            total > 1e-6, own / np.maximum(total, 1e-6), first
        )
    return weights


def _spread(weights: NDArray[np.float32], around: NDArray[np.int64], steps: int) -> NDArray[np.float32]:
    """Weights (V, C) after they flowed to the neighbours `steps` times, half of them each time."""
    for _ in range(steps):
        flow = sum(weights[near] for near in around)
        weights = 0.5 * weights + np.float32(0.5 / len(around)) * flow
    return weights
