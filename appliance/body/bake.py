"""Light, molten details and drawing order of a surface: computed once, at the export of a show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.body.skinning import Baked, BodyMesh, neighbours

OCCLUDER = 0.03  # share of the figure's height: size of the points that shade each other
SMOOTHINGS = 6
DETAIL = 0.006  # share of the figure's height: shorter edges are a face, fingers and toes
SINKINGS = 45  # steps in which details sink into the head, hand or foot that they belong to
THIN, FLAT = 0.5, 0.7  # mean normal's length: a finger would become a spike and stays, a nose sinks
REACH = 0.22  # share of the figure's height: points further away cast no shade
CURVE_BITS = 10  # an axis has so many, in the order in which faces are drawn

Floats = NDArray[np.float32]
_CELL_NUMBER = np.array([1 << 42, 1 << 21, 1])  # sorts cells by their first, second and third coordinate


def bake(mesh: BodyMesh) -> Baked:
    """Everything that a surface is drawn with besides itself; takes a third of a second for a person."""
    positions = (mesh.vertices / mesh.height).astype(np.float32)
    away, calm = sunk(positions, mesh.normals, mesh.faces)
    light = openness(positions, mesh.normals, mesh.faces)
    return Baked(light, away, calm, neighbours_together(positions, mesh.faces))


def cells(positions: Floats, size: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One vertex for each cell of space that has any, and for each vertex the number of its cell."""
    places = np.floor(positions / size).astype(np.int64)
    _, first, cell = np.unique(places @ _CELL_NUMBER, return_index=True, return_inverse=True)
    return first, cell


def neighbours_together(positions: Floats, faces: NDArray[np.int32]) -> NDArray[np.int64]:
    """(F,): the order of the faces (F, 3) along Morton's curve through space."""
    places = positions[faces].mean(axis=1)
    places = (places - places.min(axis=0)) / np.ptp(places, axis=0).max()
    cell = (places * (2**CURVE_BITS - 1)).astype(np.int64)
    along = np.zeros(len(faces), np.int64)
    for bit, axis in np.ndindex(CURVE_BITS, 3):
        along |= (cell[:, axis] >> bit & 1) << 3 * bit + axis
    return np.argsort(along, kind="stable")


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
