"""Trails: the points of hands, feet and head whose ways are drawn."""

from __future__ import annotations

import numpy as np

from appliance.pose.quaternion import Array
from appliance.projector.picture.body_buffers import BodyBuffers, merged
from appliance.projector.picture.particles import Particles


def traced(body: BodyBuffers, reach: Array, count: int) -> Particles:
    """`count` points, most of them far out along the limbs; reach (J,): how far out each joint is."""
    candidates, _ = merged(body.positions, body.faces, 0.02)
    out = np.sum(reach[body.joints[candidates]] * body.weights[candidates], axis=1)
    has_limbs = out.max() > 0.0  # a skeleton of one joint has none
    likely = np.clip(out / out.max() - 0.35, 0.0, None) ** 2 if has_limbs else np.ones(len(out))
    count = min(count, int(np.count_nonzero(likely)))
    random = np.random.RandomState(11)
    chosen = random.choice(candidates, count, replace=False, p=likely / likely.sum())
    return Particles(
        body.positions[chosen],
        body.normals[chosen],
        random.random_sample((len(chosen), 4)).astype(np.float32),
        body.joints[chosen],
        body.weights[chosen],
    )
