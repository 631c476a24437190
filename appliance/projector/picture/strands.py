"""Strands: lines that run along the limbs over the body's surface, like the grain of muscle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.projector.picture.body_buffers import BodyBuffers, merged

STEP = 0.02  # figure heights from one point of a strand to the next
POINTS = 28  # steps of a strand
OFF = 0.018  # figure heights from the nearest vertex: a strand that is further off has run past a tip
TAPER = 7  # steps in which a strand ends
SPACING, ON_HEAD = 0.048, 0.034  # figure heights between where strands start: with fewer a head is open
TURN = 0.35  # how far a strand turns around its limb, per length that it runs along it
# Where a limb's way is steeper than POLE to the skin, strands turn around its end: the whorl of the crown.
POLE, WHORL = 0.95, 1.5

Floats = NDArray[np.float32]


def ribbons_of(
    body: BodyBuffers, skeleton: Skeleton, bind_positions: Array
) -> tuple[dict[str, Any], NDArray[np.int32], int]:
    """Strands all over a body, any first part of which covers the whole of it: parts of vertices, two for
    each point of a strand, the indices of the triangles between them, and the number of strands.

    bind_positions (J, 3): the joints in the rest pose, figure heights.
    """
    first, _ = merged(body.positions, body.faces, 0.016)
    places, normals = body.positions[first], body.normals[first]
    along = along_limbs(skeleton, bind_positions)
    ways = np.einsum("vk,vkc->vc", body.weights[first], along[body.joints[first]])
    ways -= normals * np.sum(ways * normals, axis=1, keepdims=True)
    beside = np.linalg.norm(ways, axis=1, keepdims=True)
    ways += (TURN + WHORL * np.clip(1.0 - beside / POLE, 0.0, 1.0)) * np.cross(normals, ways)
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-6)
    starts, close = (merged(body.positions, body.faces, spacing)[0] for spacing in (SPACING, ON_HEAD))
    head = [
        joint for joint in range(len(skeleton)) if Anatomy(skeleton).part_of(joint) == Anatomy(skeleton).head
    ]
    starts = np.union1d(starts, close[np.isin(body.joints[close, 0], head)])
    starts = np.random.RandomState(5).permutation(starts)
    run = [(body.positions[starts], _nearest(places, body.positions[starts]))]
    backwards = _walk(run[0], -ways[run[0][1]], places, normals, ways)
    run = backwards[::-1] + run + _walk(run[0], ways[run[0][1]], places, normals, ways)
    positions = np.stack([at for at, _ in run], axis=1)
    near = np.stack([index for _, index in run], axis=1)
    runs_on = np.linalg.norm(np.diff(positions, axis=1, prepend=positions[:, :1]), axis=-1) > 0.5 * STEP
    runs_on[:, POINTS // 2] = True
    for _ in range(3):
        positions[:, 1:-1] = 0.25 * (positions[:, :-2] + 2 * positions[:, 1:-1] + positions[:, 2:])
    tangents = np.gradient(positions, axis=1)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=-1, keepdims=True), 1e-6)
    chosen = first[near]
    count, points = near.shape
    along = np.zeros((count, points, 2, 3))  # the side, the strength, a chance
    along[..., 0] = [-1.0, 1.0]
    along[..., 1] = _tapered(runs_on)[..., None]
    along[..., 2] = np.random.RandomState(6).random_sample((count, 1, 1))
    values: dict[str, Any] = {
        "position": positions.astype(np.float32),
        "tangent": tangents.astype(np.float32),
        "normal": body.normals[chosen],
        "joints": body.joints[chosen],
        "weights": body.weights[chosen],
    }
    parts = {name: np.repeat(value.reshape(-1, value.shape[-1]), 2, axis=0) for name, value in values.items()}
    corners = (2 * np.arange(count * points).reshape(count, points)[:, :-1]).reshape(-1, 1)
    indices = (corners + np.array([[0, 1, 2, 1, 3, 2]])).astype(np.int32)
    return {**parts, "along": along.reshape(-1, 3)}, indices, count


_Run = list[tuple[Array, NDArray[np.int64]]]


def _walk(
    start: tuple[Array, NDArray[np.int64]], heading: Array, places: Floats, normals: Floats, ways: Array
) -> _Run:
    """POINTS // 2 steps from the start on the surface, along its ways in the direction that changes least."""
    at, near = start
    run: _Run = []
    for _ in range(POINTS // 2):
        way = ways[near]
        way = np.where(np.sum(way * heading, axis=1, keepdims=True) < 0, -way, way)
        stepped = at + STEP * way
        next_near = _nearest(places, stepped)
        out = np.sum((stepped - places[next_near]) * normals[next_near], axis=1, keepdims=True)
        stepped = stepped - normals[next_near] * out
        off = np.linalg.norm(stepped - places[next_near], axis=1)
        goes_on = (np.sum((stepped - at) * heading, axis=1) > 0.3 * STEP) & (off < OFF)
        at = np.where(goes_on[:, None], stepped, at)
        near = np.where(goes_on, next_near, near)
        heading = np.where(goes_on[:, None], way, 0.0)
        run.append((at, near))
    return run


def _tapered(runs_on: NDArray[np.bool_]) -> Floats:
    """(S, POINTS) how strong a strand is at each of its points: nothing where it has ended."""
    middle = POINTS // 2
    ahead = np.cumprod(runs_on[:, middle:], axis=1)
    behind = np.cumprod(np.roll(runs_on, -1, axis=1)[:, middle - 1 :: -1], axis=1)[:, ::-1]
    whole = np.concatenate([behind, ahead], axis=1)
    last, first = whole.shape[1] - 1 - np.argmax(whole[:, ::-1], axis=1), np.argmax(whole, axis=1)
    place = np.arange(POINTS + 1)[None]
    from_end = np.minimum(place - first[:, None], last[:, None] - place) / TAPER
    return np.asarray(np.clip(from_end, 0, 1), np.float32)


def along_limbs(skeleton: Skeleton, bind_positions: Array) -> Array:
    """(J, 3) along the body beyond each joint, to its longest branch; it runs on from its parent."""
    length, along = np.zeros(len(skeleton)), np.zeros((len(skeleton), 3))
    for joint, offset in skeleton.ends if skeleton.stance is None else ():  # else they point elsewhere
        along[joint] = offset
    for joint in reversed(range(1, len(skeleton))):
        parent = skeleton.parents[joint]
        bone = bind_positions[joint] - bind_positions[parent]
        if length[joint] + np.linalg.norm(bone) > length[parent]:
            length[parent] = length[joint] + np.linalg.norm(bone)
            along[parent] = bone
    for joint, parent in enumerate(skeleton.parents):
        size = np.linalg.norm(along[joint])
        if size < 1e-6:
            along[joint] = along[parent] if parent >= 0 else (0.0, 1.0, 0.0)
        else:
            along[joint] /= size
        if parent >= 0 and along[joint] @ along[parent] < 0:
            along[joint] *= -1
    return along


def _nearest(places: Floats, at: Array) -> NDArray[np.int64]:
    squares = np.sum(places**2, axis=1)[None] - 2 * at @ places.T
    return np.asarray(np.argmin(squares, axis=1), np.int64)
