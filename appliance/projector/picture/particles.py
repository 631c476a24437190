"""Particles: points on the body's surface, each with its own random numbers, as parts of vertices."""

from __future__ import annotations

from typing import Any

import numpy as np

from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.projector.picture.body_buffers import BodyBuffers, merged

FINEST = 2.6  # how much smaller grains are, and closer, where the surface has details
OUT = 0.8  # share of the way from the root to the end of a limb beyond which points leave trails
Parts = dict[
    str, Any
]  # (P, ..): places in figure heights, rest pose; normals, and sizes; four chances 0 to 1; what moves them


def particles_of(body: BodyBuffers, count: int) -> Parts:
    """Spread `count` points evenly over a body, always the same ones."""
    corners = body.positions[body.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    fine = np.clip(np.sqrt(np.quantile(areas, 0.8) / np.maximum(areas, 1e-12)), 1.0, FINEST)  # face and hands
    areas = areas * fine**2
    random = np.random.RandomState(7)  # its numbers stay the same in every version of numpy
    even = (np.arange(count) + random.random_sample(count)) / count
    face = np.minimum(np.searchsorted(np.cumsum(areas) / areas.sum(), even), len(body.faces) - 1)
    u, v = random.random_sample((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = body.faces[face].T
    places, normals = (
        (1 - u - v) * values[a] + u * values[b] + v * values[c] for values in (body.positions, body.normals)
    )
    order = random.permutation(count)
    return {
        "position": places[order].astype(np.float32),
        "normal": np.column_stack([normals, 2.0 / fine[face] - 1.0])[order].astype(np.float32),
        "chance": random.random_sample((count, 4)).astype(np.float32),
        "joints": body.joints[a][order],
        "weights": body.weights[a][order],
    }


def traced(body: BodyBuffers, skeleton: Skeleton, bind_positions: Array, count: int) -> Parts:
    """`count` points that leave trails, at the ends of limbs: hands, feet and head.

    One on a shin would draw a dash across the leg.

    bind_positions (J, 3): the joints in the rest pose, figure heights.
    """
    reach = np.zeros(len(skeleton))  # how far along the bones each joint is from the root
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            reach[joint] = reach[parent] + np.linalg.norm(bind_positions[joint] - bind_positions[parent])
    ends = reach.copy()  # the same of where its limb ends
    for joint in reversed(range(1, len(skeleton))):
        ends[skeleton.parents[joint]] = max(ends[skeleton.parents[joint]], ends[joint])
    share = reach / np.maximum(ends, 1e-9)
    candidates, _ = merged(body.positions, body.faces, 0.02)
    out = np.sum(share[body.joints[candidates]] * body.weights[candidates], axis=1)
    likely = np.clip(out - OUT, 0.0, None) ** 2
    if not likely.any():  # a skeleton of one joint has no limbs
        likely[:] = 1.0
    random = np.random.RandomState(11)
    count = min(count, int(np.count_nonzero(likely)))
    chosen = random.choice(candidates, count, replace=False, p=likely / likely.sum())
    return {
        "position": body.positions[chosen],
        "normal": body.normals[chosen],
        "chance": random.random_sample((len(chosen), 4)).astype(np.float32),
        "joints": body.joints[chosen],
        "weights": body.weights[chosen],
    }
