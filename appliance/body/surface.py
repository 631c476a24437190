"""Surfaces of fields: a closed mesh where a sampled field is zero (naive surface nets, Gibson 1998)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array

_CORNERS = np.array(list(product((0, 1), repeat=3)))  # corner number = 4x + 2y + z
_EDGES = np.array([(a, b) for a in range(8) for b in range(8) if a < b and (a ^ b) in (1, 2, 4)])


_FILLED = -1e-5  # metres: a sample that is put inside lies just below the surface


@dataclass(frozen=True)
class Grid:
    """Cubes of `spacing` metres from `origin` (3,) on; shape counts the sample points along x, y, z."""

    origin: Array
    spacing: float
    shape: tuple[int, int, int]

    def axis(self, number: int) -> NDArray[np.float32]:
        """The coordinates of the samples along one axis, metres."""
        along: NDArray[np.float32] = (self.spacing * np.arange(self.shape[number])).astype(np.float32)
        return along + np.float32(self.origin[number])


def surface_of(
    field: NDArray[np.float32], grid: Grid
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    """Vertices and normals (V, 3), triangles (F, 3), of the zero level of a field, negative inside.

    The field must be positive all around. The mesh is closed, and no edge has more than two triangles: where
    the samples are ambiguous, the gap is filled.
    """
    field, codes = _without_ambiguity(field)
    cells = np.argwhere((codes > 0) & (codes < 255))
    number = np.full(codes.shape, -1, dtype=np.int32)
    number[tuple(cells.T)] = np.arange(len(cells), dtype=np.int32)
    places = _places(field, cells)
    slopes = np.stack([np.gradient(field, axis=axis) for axis in range(3)], axis=-1)
    normals = _interpolated(slopes, places)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = grid.origin + grid.spacing * places
    faces = _faces(field < 0, number, vertices)
    return vertices.astype(np.float32), (normals / np.maximum(length, 1e-9)).astype(np.float32), faces


def _without_ambiguity(field: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """The field, and each cell's inside corners as bits. Where two sheets would share a cell, its outside
    sample nearest to the surface is put inside, until no such cell is left."""
    while True:
        codes = _codes(field < 0)
        doubtful = np.argwhere(_DOUBTFUL[codes])
        if not len(doubtful):
            return field, codes
        field = field.copy()
        corners = doubtful[:, None] + _CORNERS
        values = field[tuple(corners.transpose(2, 0, 1))]
        nearest = np.where(values >= 0, values, np.inf).argmin(axis=1)
        field[tuple(corners[np.arange(len(doubtful)), nearest].T)] = _FILLED


def _codes(inside: NDArray[np.bool_]) -> NDArray[np.uint8]:
    along = [slice(None, -1), slice(1, None)]
    codes = np.zeros(tuple(n - 1 for n in inside.shape), dtype=np.uint8)
    for bit, (x, y, z) in enumerate(_CORNERS):
        codes |= inside[along[x], along[y], along[z]].astype(np.uint8) << np.uint8(bit)
    return codes


def _is_doubtful(code: int) -> bool:
    """Whether corners inside, or those outside, hang together only by a diagonal, in the cell or a face."""
    inside = [corner for corner in range(8) if code >> corner & 1]
    if not (_hangs_together(inside) and _hangs_together([c for c in range(8) if c not in inside])):
        return True
    for bit in (1, 2, 4):
        for side in (0, bit):
            face = [corner for corner in range(8) if corner & bit == side]
            if not _hangs_together([corner for corner in face if corner in inside]):
                return True
            if not _hangs_together([corner for corner in face if corner not in inside]):
                return True
    return False


def _hangs_together(corners: list[int]) -> bool:
    reached = set(corners[:1])
    while True:
        more = {c for c in corners if any((c ^ known) in (1, 2, 4) for known in reached)} - reached
        if not more:
            return len(reached) == len(corners)
        reached |= more


_DOUBTFUL = np.array([_is_doubtful(code) for code in range(256)])


def _places(field: NDArray[np.float32], cells: NDArray[np.int64]) -> Array:
    """Where each cell's vertex lies, in units of the grid: the middle of the crossings of its edges."""
    values = field[tuple((cells[:, None] + _CORNERS).transpose(2, 0, 1))]  # (cells, 8)
    first, second = values[:, _EDGES[:, 0]], values[:, _EDGES[:, 1]]
    crosses = (first < 0) != (second < 0)
    share = np.where(crosses, first / np.where(crosses, first - second, 1.0), 0.0)[..., None]
    a, b = _CORNERS[_EDGES[:, 0]], _CORNERS[_EDGES[:, 1]]
    points = np.where(crosses[..., None], a + share * (b - a), 0.0)
    middle: Array = cells + points.sum(axis=1) / crosses.sum(axis=1)[:, None]
    return middle


def _interpolated(values: NDArray[np.float32], places: Array) -> Array:
    """Trilinear values (V, C) of samples (X, Y, Z, C) at places (V, 3) in units of the grid."""
    low = np.floor(places).astype(np.int64)
    beyond = places - low
    total = np.zeros((len(places), values.shape[-1]))
    for corner in _CORNERS:
        share = np.prod(np.where(corner, beyond, 1.0 - beyond), axis=1)
        total += share[:, None] * values[tuple((low + corner).T)]
    return total


def _faces(inside: NDArray[np.bool_], number: NDArray[np.int32], vertices: Array) -> NDArray[np.int32]:
    """Two triangles for each edge of the grid that leaves the inside, counter-clockwise from outside."""
    quads = []
    for axis in range(3):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        low = np.moveaxis(inside, axis, 0)
        edges = np.argwhere(np.moveaxis(low[:-1] != low[1:], 0, axis))
        back, side = np.eye(3, dtype=np.int64)[second], np.eye(3, dtype=np.int64)[third]
        around = [edges - back - side, edges - side, edges, edges - back]
        quad = np.stack([number[tuple(cells.T)] for cells in around], axis=1)
        leaves = inside[tuple(edges.T)]
        quads.append(np.where(leaves[:, None], quad, quad[:, ::-1]))
    quad = np.concatenate(quads)
    first = np.linalg.norm(vertices[quad[:, 0]] - vertices[quad[:, 2]], axis=1)
    other = np.linalg.norm(vertices[quad[:, 1]] - vertices[quad[:, 3]], axis=1)
    split = np.where((first <= other)[:, None], quad[:, [0, 1, 2, 0, 2, 3]], quad[:, [1, 2, 3, 1, 3, 0]])
    return split.reshape(-1, 3).astype(np.int32)
