"""The body's surface on the GPU: fine for the eye, coarse for its shadows, with the hollows that light misses."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.projector.skinning import BodyMesh

COARSE = 0.02  # of the figure's height: vertices so close are one in its shadow
OCCLUDER = 0.028  # of the figure's height between the points that keep light from each other
REACH = 0.22  # of the figure's height: what is further away keeps no light off

Floats = NDArray[np.float32]
LAYOUT = "3f4 3f4 1f4 4u1 4f4"
NAMES = ("in_position", "in_normal", "in_open", "in_joints", "in_weights")


class BodyBuffers:
    """Vertices in figure heights; `fine` and `coarse` are (buffer, indices) of the same layout."""

    def __init__(self, ctx: moderngl.Context, mesh: BodyMesh) -> None:
        self.positions = (mesh.vertices / mesh.height).astype(np.float32)
        self.normals, self.joints, self.weights = mesh.normals, mesh.joints, mesh.weights
        self.faces = mesh.faces
        self.open = openness(self.positions, self.normals)
        self.fine = self._upload(ctx, np.arange(len(self.positions)), mesh.faces)
        self.coarse = self._upload(ctx, *merged(self.positions, mesh.faces, COARSE))

    def content(self, coarse: bool) -> tuple[list[tuple[Any, ...]], moderngl.Buffer]:
        """What a vertex array is made of: the buffer with its layout, and the indices."""
        vertices, indices = self.coarse if coarse else self.fine
        return [(vertices, LAYOUT, *NAMES)], indices

    @property
    def bytes(self) -> int:
        """What they take on the GPU."""
        return sum(buffer.size for pair in (self.fine, self.coarse) for buffer in pair)

    def release(self) -> None:
        for buffer in (*self.fine, *self.coarse):
            buffer.release()

    def _upload(
        self, ctx: moderngl.Context, chosen: NDArray[np.int64], faces: NDArray[np.int32]
    ) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        return ctx.buffer(self._records(chosen)), ctx.buffer(np.ascontiguousarray(faces, np.int32).tobytes())

    def _records(self, chosen: NDArray[np.int64]) -> bytes:
        kinds = [("p", "f4", 3), ("n", "f4", 3), ("o", "f4"), ("j", "u1", 4), ("w", "f4", 4)]
        records = np.zeros(len(chosen), kinds)
        parts = (self.positions, self.normals, self.open, self.joints, self.weights)
        for name, values in zip("pnojw", parts, strict=True):
            records[name] = values[chosen]
        return records.tobytes()


def merged(
    positions: Floats, faces: NDArray[np.int32], cell: float
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """One vertex for all in a cell of space: which vertices stay, and the faces between those that stay."""
    _, first, now = np.unique(
        np.floor(positions / cell).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    merged = now.reshape(-1)[faces]
    whole = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    return first, merged[whole].astype(np.int32)


def openness(positions: Floats, normals: Floats) -> Floats:
    """(V,) 0..1: how much of the light from all around reaches each point of a body with spread limbs."""
    _, first = np.unique(np.floor(positions / OCCLUDER).astype(np.int64), axis=0, return_index=True)
    blockers, facing = positions[first], normals[first]
    open_ = np.empty(len(positions), np.float32)
    for start in range(0, len(positions), 512):
        part = slice(start, start + 512)
        way = blockers[None] - positions[part, None]
        distance = np.linalg.norm(way, axis=-1) + 1e-4
        above = np.einsum("vbc,vc->vb", way, normals[part]) / distance
        towards = -np.einsum("vbc,bc->vb", way, facing) / distance
        share = (
            np.clip(above - 0.08, 0, 1) * np.clip(towards, 0, 1) * OCCLUDER**2 / (distance**2 + OCCLUDER**2)
        )
        open_[part] = np.exp(-1.6 * np.sum(share * (distance < REACH), axis=1))
    return open_
