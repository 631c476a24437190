"""Surfaces of fields: a closed mesh where a sampled field is zero (naive surface nets, Gibson 1998)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array

_CORNERS = np.array(list(product((0, 1), repeat=3)))  # corner number = 4x + 2y + z


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


@dataclass(frozen=True)
class Finer:
    """A box of a grid in cells half as large: from cell `low` (3,) on, with the samples of its field.

    The outermost cells of the box only lend their samples: the surface in them is coarse.
    """

    low: NDArray[np.int64]
    field: NDArray[np.float32]


def finer_grid(grid: Grid, low: NDArray[np.int64], high: NDArray[np.int64]) -> Grid:
    """The samples of `Finer`, for the cells from `low` to before `high` (3,)."""
    shape = [int(n) for n in 2 * (high - low) + 1]
    return Grid(grid.origin + grid.spacing * low, grid.spacing / 2, (shape[0], shape[1], shape[2]))


def surface_of(
    field: NDArray[np.float32], grid: Grid, finer: Sequence[Finer] = ()
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    """Vertices and normals (V, 3), triangles (F, 3), of the zero level of a field, negative inside.

    The field must be positive all around. The mesh is closed, and no edge has more than two triangles: where
    the samples are ambiguous, the gap is filled. Where cells of two sizes meet, an edge of the smaller ones
    gets one triangle instead of two, as in dual contouring (Ju et al. 2002). Pairs of triangles come first.
    """
    small, refined = _small_field(field, finer)
    field, small = _agreeing(field, small, refined, finer)
    places, corners = [], []
    for level, (values, cells) in enumerate(((field, ~refined), (small, _halved(refined)))):
        for axis in range(3):
            crossings, around = _crossed(values, cells, axis, all_cells=level == 0)
            places.append(crossings / (1 + level))
            corners.append(_leaves(around, refined, small.shape if level else ()))
    crossing, around = np.concatenate(places), np.concatenate(corners)
    leaves, quads = np.unique(around, return_inverse=True)
    quads = quads.reshape(-1, 4)
    count = np.bincount(quads.reshape(-1), minlength=len(leaves))
    mean = np.stack(
        [
            np.bincount(quads.reshape(-1), np.repeat(crossing[:, axis], 4), len(leaves)) / count
            for axis in range(3)
        ],
        axis=1,
    )
    vertices = grid.origin + grid.spacing * mean
    is_small = leaves >= refined.size
    normals = np.empty_like(vertices)
    normals[~is_small] = _slopes(field, mean[~is_small])
    normals[is_small] = _slopes(small, 2 * mean[is_small])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    faces = _triangles(quads, vertices)
    return vertices.astype(np.float32), normals.astype(np.float32), faces


def _small_field(
    field: NDArray[np.float32], finer: Sequence[Finer]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The boxes' samples in one array, half as far apart, and which cells (of `field`) are halved."""
    refined = np.zeros(tuple(n - 1 for n in field.shape), dtype=np.bool_)
    if not finer:
        return np.ones((1, 1, 1), np.float32), refined
    small = np.ones(tuple(2 * n - 1 for n in field.shape), dtype=np.float32)
    for box in finer:
        small[_samples_of(box)] = box.field
        sides = zip(box.low, box.field.shape, strict=True)
        refined[tuple(slice(int(a) + 1, int(a) + n // 2 - 1) for a, n in sides)] = True
    return small, refined


def _samples_of(box: Finer) -> tuple[slice, ...]:
    first = 2 * box.low
    return tuple(slice(int(a), int(a) + n) for a, n in zip(first, box.field.shape, strict=True))


def _agreeing(
    field: NDArray[np.float32],
    small: NDArray[np.float32],
    refined: NDArray[np.bool_],
    finer: Sequence[Finer],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Both fields without ambiguity, equal at the corners of halved cells.

    The surface crosses an edge between whole and halved cells once at most: crossed twice, it would give an
    edge four triangles.
    """
    if not refined.any():
        return _without_ambiguity(field), small
    low, middle, high = _edges_between(refined)
    shared = np.zeros(field.shape, dtype=np.bool_)
    for x, y, z in _CORNERS:
        shared[x : x + refined.shape[0], y : y + refined.shape[1], z : z + refined.shape[2]] |= refined
    while True:
        for box in finer:
            part = _samples_of(box)
            small[part] = _without_ambiguity(small[part])
        values = [small[tuple(places.T)] for places in (low, middle, high)]
        inside = [value < 0 for value in values]
        twice = (inside[0] == inside[2]) & (inside[1] != inside[0])
        nearer = np.where((values[0] <= values[2])[:, None], low, high)
        small[tuple(np.where(inside[1][:, None], nearer, middle)[twice].T)] = _FILLED
        field = np.where(shared, small[::2, ::2, ::2], field)
        field = _without_ambiguity(field)
        differs = shared & ((field < 0) != (small[::2, ::2, ::2] < 0))
        if not (differs.any() or twice.any()):
            return field, small
        small[::2, ::2, ::2][differs] = field[differs]


def _edges_between(refined: NDArray[np.bool_]) -> tuple[NDArray[np.int64], ...]:
    """One end, the middle and the other end, (E, 3) each in small samples, of the edges that whole and halved
    cells share."""
    found = []
    for axis in range(3):
        cells = np.moveaxis(refined, axis, 2)
        one, other = cells[:-1] | cells[1:], cells[:-1] & cells[1:]
        edges = 2 * np.argwhere((one[:, :-1] | one[:, 1:]) & ~(other[:, :-1] & other[:, 1:]))
        low = np.insert(edges[:, :2] + 2, axis, edges[:, 2], axis=1)
        ahead = np.eye(3, dtype=np.int64)[axis]
        found.append(np.stack([low, low + ahead, low + 2 * ahead]))
    return tuple(np.concatenate(found, axis=1))


def _halved(refined: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same for cells of half the size."""
    for axis in range(3):
        refined = np.repeat(refined, 2, axis=axis)
    return refined


def _crossed(
    field: NDArray[np.float32], cells: NDArray[np.bool_], axis: int, all_cells: bool
) -> tuple[Array, NDArray[np.int64]]:
    """Where edges along an axis cross the surface (E, 3), in samples, and the cells around each, (E, 4, 3),
    counter-clockwise seen from outside. Includes edges with only some of their cells in `cells`."""
    inside = field < 0
    low = np.moveaxis(inside, axis, 0)
    edges = np.argwhere(np.moveaxis(low[:-1] != low[1:], 0, axis))
    back, side = np.eye(3, dtype=np.int64)[(axis + 1) % 3], np.eye(3, dtype=np.int64)[(axis + 2) % 3]
    around = np.stack([edges - back - side, edges - side, edges, edges - back], axis=1)
    among = cells[tuple(np.moveaxis(around, -1, 0))]
    kept = among.all(axis=1) if all_cells else among.any(axis=1)
    edges, around = edges[kept], around[kept]
    ahead = np.eye(3, dtype=np.int64)[axis]
    first, second = field[tuple(edges.T)], field[tuple((edges + ahead).T)]
    crossings = edges + (first / (first - second))[:, None] * ahead
    return crossings, np.where((first < 0)[:, None, None], around, around[:, ::-1])


def _leaves(
    around: NDArray[np.int64], refined: NDArray[np.bool_], small_shape: tuple[int, ...]
) -> NDArray[np.int64]:
    """(E, 4): numbers of small cells, or of the whole cells that they are parts of; without the shape of the
    small samples those of whole cells."""
    if not small_shape:
        return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(around, -1, 0)), refined.shape))
    coarse = tuple(np.moveaxis(around // 2, -1, 0))
    whole = np.ravel_multi_index(coarse, refined.shape)
    shape = tuple(n - 1 for n in small_shape)
    small = refined.size + np.ravel_multi_index(tuple(np.moveaxis(around, -1, 0)), shape)
    leaves: NDArray[np.int64] = np.where(refined[coarse], small, whole)
    return leaves


def _slopes(field: NDArray[np.float32], places: Array) -> Array:
    """(V, 3): how the field grows at places in samples, over a sample to both sides."""
    steps = 0.7 * np.eye(3)
    slopes: Array = np.stack(
        [_interpolated(field, places + s) - _interpolated(field, places - s) for s in steps], axis=1
    )
    return slopes


def _triangles(quads: NDArray[np.int64], vertices: Array) -> NDArray[np.int32]:
    """(F, 3): two for each quad, split along its shorter diagonal, then one for each that has two corners in
    one vertex."""
    again = quads == np.roll(quads, 1, axis=1)
    whole = ~again.any(axis=1)
    quad = quads[whole]
    first = np.linalg.norm(vertices[quad[:, 0]] - vertices[quad[:, 2]], axis=1)
    other = np.linalg.norm(vertices[quad[:, 1]] - vertices[quad[:, 3]], axis=1)
    split = np.where((first <= other)[:, None], quad[:, [0, 1, 2, 0, 2, 3]], quad[:, [1, 2, 3, 1, 3, 0]])
    folded, at = quads[~whole], again[~whole].argmax(axis=1)
    single = np.take_along_axis(folded, (at[:, None] + np.arange(3)) % 4, axis=1)
    return np.concatenate([split.reshape(-1, 3), single]).astype(np.int32)


def _without_ambiguity(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Where two sheets would share a cell, its outside sample nearest to the surface is put inside, until no
    such cell is left."""
    while True:
        doubtful = np.argwhere(_DOUBTFUL[_codes(field < 0)])
        if not len(doubtful):
            return field
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


def _interpolated(field: NDArray[np.float32], places: Array) -> Array:
    """(V,): trilinear values of samples at places (V, 3) in units of the grid."""
    low = np.clip(np.floor(places).astype(np.int64), 0, np.array(field.shape) - 2)
    beyond = places - low
    total = np.zeros(len(places))
    for corner in _CORNERS:
        share = np.prod(np.where(corner, beyond, 1.0 - beyond), axis=1)
        total += share * field[tuple((low + corner).T)]
    return total
