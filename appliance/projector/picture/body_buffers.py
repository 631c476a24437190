"""The body's surface on the GPU: fine for the eye, coarse for shadows; and how much light reaches it."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.body.skinning import BodyMesh, neighbours
from appliance.projector.picture.vertices import layout, packed

COARSE = 0.02  # share of the figure's height: vertices closer than this are merged for shadows
OCCLUDER = 0.03  # share of the figure's height: size of the points that shade each other
SMOOTHINGS = 6
DETAIL = 0.006  # share of the figure's height: shorter edges are a face, fingers and toes
SINKINGS = 45  # steps in which details sink into the head, hand or foot that they belong to
THIN, FLAT = 0.5, 0.7  # mean normal's length: a finger would become a spike and stays, a nose sinks
REACH = 0.22  # share of the figure's height: points further away cast no shade

Floats = NDArray[np.float32]
CURVE_BITS = 10  # an axis has so many, in the order in which faces are drawn
PARTS = ("position", "normal", "sunk", "calm", "joints", "weights")


class BodyBuffers:
    """The surface in figure heights, rest pose; content(coarse) is what a vertex array is made of.

    positions, normals: (V, 3); joints, weights: (V, 4); faces: (F, 3); open: (V,) how much light comes near.
    A figure that melts loses its details first: then a vertex is `sunk` (V, 3) away, with the normal `calm`.
    """

    def __init__(self, ctx: moderngl.Context, mesh: BodyMesh) -> None:
        self.positions = (mesh.vertices / mesh.height).astype(np.float32)
        self.normals, self.joints, self.weights = mesh.normals, mesh.joints, mesh.weights
        self.faces = mesh.faces
        self.open = openness(self.positions, self.normals, mesh.faces)
        self.sunk, self.calm = sunk(self.positions, self.normals, mesh.faces)
        self._fine = self._uploaded(ctx, np.arange(len(self.positions)), mesh.faces)
        self._coarse = self._uploaded(ctx, *merged(self.positions, mesh.faces, COARSE))

    def content(self, coarse: bool) -> tuple[list[tuple[Any, ...]], moderngl.Buffer]:
        """The vertices with their layout, and the indices."""
        vertices, indices = self._coarse if coarse else self._fine
        return [(vertices, *layout(PARTS))], indices

    def release(self) -> None:
        for buffer in (*self._fine, *self._coarse):
            buffer.release()

    def _uploaded(
        self, ctx: moderngl.Context, chosen: NDArray[np.int64], faces: NDArray[np.int32]
    ) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        chosen, faces = neighbours_together(self.positions, chosen, faces)
        whole = np.concatenate([self.normals, self.open[:, None]], axis=1)
        values: tuple[Any, ...] = (
            *(self.positions, whole, self.sunk),
            *(self.calm, self.joints, self.weights),
        )
        parts = {name: value[chosen] for name, value in zip(PARTS, values, strict=True)}
        return ctx.buffer(packed(parts)), ctx.buffer(np.ascontiguousarray(faces, np.int32).tobytes())


def cells(positions: Floats, size: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One vertex for each cell of space that has any, and for each vertex the number of its cell."""
    places = np.floor(positions / size).astype(np.int64)
    _, first, cell = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return first, cell.reshape(-1)


def merged(
    positions: Floats, faces: NDArray[np.int32], size: float
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """One vertex for all in a cell of space: which vertices stay, and the faces between those that stay."""
    first, cell = cells(positions, size)
    corners = cell[faces]
    a, b, c = corners.T
    return first, corners[(a != b) & (b != c) & (c != a)].astype(np.int32)


def neighbours_together(
    positions: Floats, chosen: NDArray[np.int64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The chosen vertices and the faces (F, 3) between them, in another order: faces along Morton's curve
    through space, vertices as the faces come to them. A GPU then moves each vertex once and not twice.
    """
    places = positions[chosen][faces].mean(axis=1)
    places = (places - places.min(axis=0)) / np.ptp(places, axis=0).max()
    cell = (places * (2**CURVE_BITS - 1)).astype(np.int64)
    along = np.zeros(len(faces), np.int64)
    for bit, axis in np.ndindex(CURVE_BITS, 3):
        along |= (cell[:, axis] >> bit & 1) << 3 * bit + axis
    faces = faces[np.argsort(along, kind="stable")]
    used, first = np.unique(faces, return_index=True)
    order = used[np.argsort(first)]
    number = np.zeros(len(chosen), np.int32)
    number[order] = np.arange(len(order))
    return chosen[order], number[faces]


def openness(positions: Floats, normals: Floats, faces: NDArray[np.int32]) -> Floats:
    """(V,) 0..1: how much of the light from all around reaches each point of a body with spread limbs.

    Computed for one point of each cell, then smoothed along the surface.
    """
    first, cell = cells(positions, OCCLUDER)
    at, facing = positions[first], normals[first]
    way = at[None] - at[:, None]
    distance = np.linalg.norm(way, axis=-1) + 1e-4
    above = np.einsum("vbc,vc->vb", way, facing) / distance
    towards = -np.einsum("vbc,bc->vb", way, facing) / distance
    area = OCCLUDER**2 / (distance**2 + OCCLUDER**2)
    kept_off = np.clip(above - 0.08, 0, 1) * np.clip(towards, 0, 1) * area * (distance < REACH)
    values = np.exp(-1.6 * kept_off.sum(axis=1))[cell]
    corners, count = faces.reshape(-1), np.bincount(faces.reshape(-1), minlength=len(positions))
    for _ in range(SMOOTHINGS):
        of_faces = np.repeat(values[faces].mean(axis=1), 3)
        values = np.bincount(corners, of_faces, len(positions)) / np.maximum(count, 1)
    return np.asarray(values, np.float32)


def sunk(positions: Floats, normals: Floats, faces: NDArray[np.int32]) -> tuple[Floats, Floats]:
    """(V, 3) each: the way of a vertex, in heights, and its normal, when the face is smooth."""
    corners = positions[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    count = np.maximum(np.bincount(faces.reshape(-1), minlength=len(positions)), 1)
    is_detail = np.bincount(faces.reshape(-1), np.repeat(edges, 3), len(positions)) / count < DETAIL
    chosen, near = np.unique(faces[is_detail[faces].any(axis=1)], return_inverse=True)
    values = np.concatenate([positions, normals], axis=1)[chosen]
    if len(chosen):
        around = neighbours(near.reshape(-1, 3).astype(np.int32), len(chosen))
        moves = is_detail[chosen]
        for _ in range(SINKINGS):
            values[moves] = values[around[:, moves]].mean(axis=0)
    away, calm = np.zeros_like(positions), normals.copy()
    alike = np.linalg.norm(values[:, 3:], axis=1, keepdims=True)  # the length is small around a finger
    whole = np.clip((alike - THIN) / (FLAT - THIN), 0.0, 1.0)
    away[chosen] = whole * (values[:, :3] - positions[chosen])
    mixed = (1.0 - whole) * normals[chosen] + whole * values[:, 3:] / np.maximum(alike, 1e-6)
    calm[chosen] = mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-6)
    return away, calm
