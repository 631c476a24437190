"""Strands: lines that run along the limbs over the body's surface, like the grain of muscle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.projector.body_buffers import BodyBuffers, merged

STEP = 0.014  # figure heights from one point of a strand to the next
POINTS = 34  # of a strand
SPACING = 0.06  # figure heights between where strands start
TURN = 0.35  # how far a strand turns around its limb, per length that it runs along it

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Strands:
    """(S, POINTS, ..): places and the directions at them, in figure heights, rest pose; normals; what moves
    them."""

    positions: Floats
    tangents: Floats
    normals: Floats
    joints: NDArray[np.uint8]
    weights: Floats


def strands_of(body: BodyBuffers, skeleton: Skeleton, bind_positions: Array) -> Strands:
    """Strands all over a body; bind_positions (J, 3): its joints in the rest pose, figure heights."""
    first, _ = merged(body.positions, body.faces, 0.016)
    places, normals = body.positions[first], body.normals[first]
    along = _along(skeleton, bind_positions)
    ways = np.einsum("vk,vkc->vc", body.weights[first], along[body.joints[first]])
    ways += TURN * np.cross(normals, ways)
    ways -= normals * np.sum(ways * normals, axis=1, keepdims=True)
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-6)
    starts, _ = merged(body.positions, body.faces, SPACING)
    halves = []
    for sign in (-1.0, 1.0):
        at, half = body.positions[starts].copy(), []
        for _ in range(POINTS // 2):
            near = _nearest(places, at)
            half.append((at, near))
            at = at + sign * STEP * ways[near]
            at = at - normals[near] * np.sum((at - places[near]) * normals[near], axis=1, keepdims=True)
        halves.append(half)
    run = halves[0][::-1] + halves[1]
    positions = np.stack([at for at, _ in run], axis=1)
    near = np.stack([index for _, index in run], axis=1)
    tangents = np.gradient(positions, axis=1)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=-1, keepdims=True), 1e-6)
    chosen = first[near]
    return Strands(
        positions.astype(np.float32),
        tangents.astype(np.float32),
        body.normals[chosen],
        body.joints[chosen],
        body.weights[chosen],
    )


def reach_of(skeleton: Skeleton, bind_positions: Array) -> Array:
    """(J,) how far along the bones each joint is from the root, figure heights."""
    reach = np.zeros(len(skeleton))
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            reach[joint] = reach[parent] + np.linalg.norm(bind_positions[joint] - bind_positions[parent])
    return reach


def _along(skeleton: Skeleton, bind_positions: Array) -> Array:
    """(J, 3) the direction in which the body goes on beyond each joint: to its children, away from the root."""
    along = np.zeros((len(skeleton), 3))
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            along[parent] += bind_positions[joint] - bind_positions[parent]
    for joint, offset in skeleton.ends:
        along[joint] += offset
    for joint, parent in enumerate(skeleton.parents):
        if np.linalg.norm(along[joint]) < 1e-6 and parent >= 0:
            along[joint] = bind_positions[joint] - bind_positions[parent]
    return np.asarray(along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-6))


def _nearest(places: Floats, at: Array) -> NDArray[np.int64]:
    squares = np.sum(places**2, axis=1)[None] - 2 * at @ places.T
    return np.asarray(np.argmin(squares, axis=1), np.int64)
