"""Particles: points spread evenly over the body's surface, each with chances of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.projector.picture.body_buffers import BodyBuffers

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Particles:
    """(P, ..): places in figure heights, rest pose; normals; four chances from 0 to 1; what moves them."""

    positions: Floats
    normals: Floats
    chances: Floats
    joints: NDArray[np.uint8]
    weights: Floats

    def parts(self) -> dict[str, Any]:
        """As parts of vertices."""
        return {
            "position": self.positions,
            "normal": self.normals,
            "chance": self.chances,
            "joints": self.joints,
            "weights": self.weights,
        }


def particles_of(body: BodyBuffers, count: int) -> Particles:
    """Spread `count` points over a body, always the same ones."""
    corners = body.positions[body.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
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
    return Particles(
        places[order].astype(np.float32),
        normals[order].astype(np.float32),
        random.random_sample((count, 4)).astype(np.float32),
        body.joints[a][order],
        body.weights[a][order],
    )
