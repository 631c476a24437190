"""Volumes that a body is modelled of: rounded slabs, smoothly joined, sampled as a signed distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.body.surface import Grid
from appliance.pose.quaternion import Array

FAR = 1.0  # metres: the field where no volume is near
MARGIN = 4.5  # in samples: how far around a volume its distance is known
SMOOTHINGS = 2  # how often the field is smoothed over its neighbours: 2 mm off a wrist, no ridges


@dataclass(frozen=True)
class Slab:
    """A rounded board: from `start` to `end` (3,), to both sides towards `across` by `start_half` and
    `end_half`, as thick as the radii; a rounded cone when the halves are zero. Metres.

    owner: the joint that moves it; softness: over how many metres it melts into what was made before it.
    """

    owner: int
    start: Array
    end: Array
    start_radius: float
    end_radius: float
    softness: float
    across: Array
    start_half: float = 0.0
    end_half: float = 0.0

    @property
    def box(self) -> tuple[Array, Array]:
        """The lowest and highest corner (3,) of a box around it."""
        one = self.start_radius + self.start_half * np.abs(self.across)
        other = self.end_radius + self.end_half * np.abs(self.across)
        return np.minimum(self.start - one, self.end - other), np.maximum(self.start + one, self.end + other)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """Metres from its surface, negative inside, of points with coordinates of any matching shapes."""
        bone = self.end - self.start
        length2 = max(float(bone @ bone), 1e-12)
        dx, dy, dz = (
            (value - np.float32(at)).astype(np.float32)
            for value, at in zip((x, y, z), self.start, strict=True)
        )
        along = _dot(dx, dy, dz, bone) / np.float32(length2)
        part = np.clip(along, 0.0, 1.0)
        squared = dx * dx + dy * dy + dz * dz + np.float32(length2) * part * (part - 2 * along)
        if self.start_half or self.end_half:
            aside = _dot(dx, dy, dz, perpendicular(self.across, bone))
            half = np.float32(self.start_half) + np.float32(self.end_half - self.start_half) * part
            held = aside * half / np.sqrt(half * half + aside * aside + np.float32(1e-12))  # no flat front
            squared = squared + held * (held - 2 * aside)
        radius = np.float32(self.start_radius) + np.float32(self.end_radius - self.start_radius) * part
        away: Array = np.sqrt(np.maximum(squared, 0.0)) - radius
        return away


@dataclass(frozen=True)
class Cut:
    """Takes away what lies beyond a plane through `point` whose `normal` points outwards, only near `point`.

    reach: metres from the point along which it cuts; softness: over how many metres the edge is rounded.
    """

    point: Array
    normal: Array
    reach: float
    softness: float


@dataclass(frozen=True)
class Group:
    """Slabs and cuts in the order in which they are made; `softness` of where the group joins the others.

    bones: which joints move the group besides its slabs: the fingers of a mitten.
    """

    steps: tuple[Slab | Cut, ...]
    softness: float
    bones: tuple[Slab, ...] = ()

    @property
    def slabs(self) -> list[Slab]:
        return [step for step in self.steps if isinstance(step, Slab)]

    @property
    def movers(self) -> list[Slab]:
        """Volumes that decide which joint moves what; bones replace the slabs of the first bone's joint."""
        by_bones = self.bones[0].owner if self.bones else None
        return [*(slab for slab in self.slabs if slab.owner != by_bones), *self.bones]


def sampled(trunk: Group, limbs: Sequence[Group], spacing: float) -> tuple[NDArray[np.float32], Grid]:
    """The field of a trunk and limbs that melt into it, but not into each other, on a grid around them.

    The grid is symmetrical about x = 0, so that a symmetrical body gives a symmetrical surface.
    """
    grid = _grid_around([slab for group in (trunk, *limbs) for slab in group.slabs], spacing)
    field = np.full(grid.shape, FAR, dtype=np.float32)
    body = _sample(trunk, grid, field.copy())
    total = body.copy()
    for limb in limbs:
        alone = _sample(limb, grid, field.copy())
        near = _window([slab.box for slab in limb.slabs], grid)
        joined = smooth_minimum(body[near], alone[near], limb.softness)
        total[near] = np.minimum(total[near], joined)
    for _ in range(SMOOTHINGS):
        for axis in range(3):
            total = _smoothed(np.moveaxis(total, axis, 0), axis)
    return total, grid


def smooth_minimum(a: Array, b: Array, softness: float) -> Array:
    """The lesser of two distances, rounded where they differ by less than `softness` metres (Quilez)."""
    if softness <= 0.0:
        return np.minimum(a, b)
    near = np.maximum(np.float32(softness) - np.abs(a - b), 0.0)
    joined: Array = np.minimum(a, b) - near * near * np.float32(0.25 / softness)
    return joined


def perpendicular(side: Array, direction: Array) -> Array:
    """The side, turned perpendicular to a direction, unit length (3,); zero where the two are parallel."""
    rest = side - direction * float(side @ direction) / max(float(direction @ direction), 1e-12)
    length = float(np.linalg.norm(rest))
    unit: Array = rest / length if length > 1e-3 else np.zeros(3)
    return unit


def _sample(group: Group, grid: Grid, field: NDArray[np.float32]) -> NDArray[np.float32]:
    for step in group.steps:
        if isinstance(step, Slab):
            near = _window([step.box], grid)
            field[near] = smooth_minimum(field[near], step.distance(*_coordinates(grid, near)), step.softness)
        else:
            near = _window([(step.point - step.reach, step.point + step.reach)], grid)
            x, y, z = _coordinates(grid, near)
            beyond = _dot(
                x - np.float32(step.point[0]),
                y - np.float32(step.point[1]),
                z - np.float32(step.point[2]),
                step.normal,
            )
            field[near] = -smooth_minimum(-field[near], -beyond, step.softness)
    return field


def _smoothed(field: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """The mean 1 2 1 along the first axis, which is then put back to its place."""
    mean = field.copy()
    mean[1:-1] = 0.5 * field[1:-1] + 0.25 * (field[:-2] + field[2:])
    return np.moveaxis(mean, 0, axis)


def _grid_around(slabs: Sequence[Slab], spacing: float) -> Grid:
    boxes = [slab.box for slab in slabs]
    low = np.min([box[0] for box in boxes], axis=0) - (MARGIN + 2) * spacing
    high = np.max([box[1] for box in boxes], axis=0) + (MARGIN + 2) * spacing
    low[0] = min(low[0], -high[0])
    low[0] = -np.ceil(-low[0] / spacing) * spacing  # x = 0 is a plane of samples
    high[0] = -low[0]
    shape = tuple(int(n) for n in np.round((high - low) / spacing).astype(int) + 1)
    return Grid(low, spacing, (shape[0], shape[1], shape[2]))


def _window(boxes: Sequence[tuple[Array, Array]], grid: Grid) -> tuple[slice, slice, slice]:
    low = np.min([box[0] for box in boxes], axis=0)
    high = np.max([box[1] for box in boxes], axis=0)
    first = np.floor((low - grid.origin) / grid.spacing - MARGIN).astype(int)
    last = np.ceil((high - grid.origin) / grid.spacing + MARGIN).astype(int) + 1
    x, y, z = (slice(max(0, int(a)), int(b)) for a, b in zip(first, last, strict=True))
    return x, y, z


def _coordinates(grid: Grid, window: tuple[slice, slice, slice]) -> tuple[Array, Array, Array]:
    x, y, z = (grid.axis(number)[part] for number, part in enumerate(window))
    return x[:, None, None], y[None, :, None], z[None, None, :]


def _dot(x: Array, y: Array, z: Array, vector: Array) -> Array:
    total: Array = x * np.float32(vector[0]) + y * np.float32(vector[1]) + z * np.float32(vector[2])
    return total
