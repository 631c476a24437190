"""Volumes that a body is modelled of: rounded slabs and ellipsoids, smoothly joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.body.surface import Grid
from appliance.pose.quaternion import Array

FAR = 60.0  # in samples: the field where no volume is near
MARGIN = 4.5  # in samples: how far around a volume its distance is known


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
    removes: bool = False

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
class Ball:
    """An ellipsoid about `middle` (3,): half axes `radii` (3,), metres, along the rows of `axes` (3, 3).

    removes: it is taken away from what was made before it. `distance` is exact only near the surface.
    """

    owner: int
    middle: Array
    radii: Array
    axes: Array
    softness: float
    removes: bool = False

    @property
    def box(self) -> tuple[Array, Array]:
        """The lowest and highest corner (3,) of a box around it."""
        reach = np.sqrt(((self.radii[:, None] * self.axes) ** 2).sum(axis=0))
        return self.middle - reach, self.middle + reach

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """Metres from its surface, negative inside, of points as a slab takes them (Quilez)."""
        dx, dy, dz = (
            (value - np.float32(at)).astype(np.float32)
            for value, at in zip((x, y, z), self.middle, strict=True)
        )
        once = [_dot(dx, dy, dz, axis / radius) for axis, radius in zip(self.axes, self.radii, strict=True)]
        first = np.sqrt(sum(part * part for part in once))
        steep = np.sqrt(sum((part / np.float32(r)) ** 2 for part, r in zip(once, self.radii, strict=True)))
        away: Array = first * (first - np.float32(1.0)) / np.maximum(steep, np.float32(1e-6))
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
    removes: bool = True

    @property
    def box(self) -> tuple[Array, Array]:
        """The lowest and highest corner (3,) of where it cuts."""
        return self.point - self.reach, self.point + self.reach

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """Metres from the plane, negative beyond it, of points with coordinates of any matching shapes."""
        px, py, pz = (np.float32(value) for value in self.point)
        return -_dot(x - px, y - py, z - pz, self.normal)


@dataclass(frozen=True)
class Loft:
    """Elliptical sections across the straight line between the ends of `axis` (N, 3), rounded at its ends.

    wide (N,), deep (N,): half the width towards `across` and half the depth at a right angle to it, metres;
    movers: which joints move it.
    """

    axis: Array
    wide: Array
    deep: Array
    across: Array
    softness: float
    movers: tuple[Slab, ...]
    removes: bool = False

    @property
    def box(self) -> tuple[Array, Array]:
        """The lowest and highest corner (3,) of a box around it."""
        reach = np.maximum(self.wide, self.deep)[:, None]
        return (self.axis - reach).min(axis=0), (self.axis + reach).max(axis=0)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """Metres from its surface, negative inside, of points as a slab takes them."""
        line = self.axis[-1] - self.axis[0]
        line = line / max(float(np.linalg.norm(line)), 1e-9)
        side = perpendicular(self.across, line)
        ways = line, side, np.cross(line, side)
        places = np.maximum.accumulate((self.axis - self.axis[0]) @ line)
        dx, dy, dz = (
            (value - np.float32(at)).astype(np.float32)
            for value, at in zip((x, y, z), self.axis[0], strict=True)
        )
        up, aside, ahead = (_dot(dx, dy, dz, way) for way in ways)
        centres = ((self.axis - self.axis[0]) @ way for way in ways[1:])
        middle, before, wide, deep = (
            np.interp(up, places, table).astype(np.float32) for table in (*centres, self.wide, self.deep)
        )
        aside, ahead, beyond = aside - middle, ahead - before, up - np.clip(up, 0.0, np.float32(places[-1]))
        first = np.sqrt((aside / wide) ** 2 + (ahead / deep) ** 2 + (beyond / deep) ** 2)
        steep = np.sqrt((aside / wide**2) ** 2 + (ahead / deep**2) ** 2 + (beyond / deep**2) ** 2)
        away: Array = first * (first - np.float32(1.0)) / np.maximum(steep, np.float32(1e-6))
        return away


def loft(
    owners: Sequence[int], axis: Array, wide: Array, deep: Array, across: Array, softness: float
) -> Loft:
    """Sections with a volume for each piece that says what moves it; owners: the joint of each section."""
    movers = tuple(
        Slab(owner, low, high, thin, thin, 0.0, across, half, half)
        for owner, low, high, thin, half in zip(
            owners, axis, axis[1:], np.minimum(wide, deep), np.maximum(wide - deep, 0.0), strict=False
        )
    )
    return Loft(axis, wide, deep, across, softness, movers)


Step = Slab | Ball | Loft | Cut


@dataclass(frozen=True)
class Group:
    """Volumes and cuts in the order in which they are made; `softness` of where the group joins the others.

    bones: which joints move the group besides its volumes: the fingers of a mitten.
    """

    steps: tuple[Step, ...]
    softness: float
    bones: tuple[Slab, ...] = ()

    @property
    def solids(self) -> list[Slab | Ball | Loft]:
        return [step for step in self.steps if not isinstance(step, Cut) and not step.removes]

    @property
    def movers(self) -> list[Slab | Ball]:
        """Volumes that decide which joint moves what; bones replace the volumes of the first bone's joint."""
        by_bones = self.bones[0].owner if self.bones else None
        found: list[Slab | Ball] = []
        for solid in self.solids:
            found += solid.movers if isinstance(solid, Loft) else [solid]
        return [*(mover for mover in found if mover.owner != by_bones), *self.bones]


def grid_around(groups: Sequence[Group], spacing: float) -> Grid:
    """A grid symmetrical about x = 0, so that a symmetrical body gives a symmetrical surface."""
    boxes = [solid.box for group in groups for solid in group.solids]
    low = np.min([box[0] for box in boxes], axis=0) - (MARGIN + 2) * spacing
    high = np.max([box[1] for box in boxes], axis=0) + (MARGIN + 2) * spacing
    low[0] = min(low[0], -high[0])
    low[0] = -np.ceil(-low[0] / spacing) * spacing  # x = 0 is a plane of samples
    high[0] = -low[0]
    shape = tuple(int(n) for n in np.round((high - low) / spacing).astype(int) + 1)
    return Grid(low, spacing, (shape[0], shape[1], shape[2]))


def sampled(trunk: Group, limbs: Sequence[Group], grid: Grid) -> NDArray[np.float32]:
    """The field of a trunk and of limbs that melt into it, but not into each other, on a grid."""
    total = np.full(grid.shape, FAR * grid.spacing, dtype=np.float32)
    _make(trunk, grid, total)
    body = total.copy()
    for limb in limbs:
        near = _window([solid.box for solid in limb.solids], grid, limb.softness)
        part = body[near]
        if part.size:
            alone = np.full(part.shape, FAR * grid.spacing, dtype=np.float32)
            _make(limb, _part_of(grid, near), alone)
            total[near] = np.minimum(total[near], smooth_minimum(part, alone, limb.softness))
    return total


def smooth_minimum(a: Array, b: Array, softness: float) -> Array:
    """The lesser of two distances, rounded where they differ by less than `softness` metres (Quilez)."""
    if softness <= 0.0:
        return np.minimum(a, b)
    near = np.maximum(np.float32(softness) - np.abs(a - b), 0.0)
    joined: Array = np.minimum(a, b) - near * near * np.float32(0.25 / softness)
    return joined


def settled(trunk: Group, limbs: Sequence[Group], points: Array, spacing: float) -> tuple[Array, Array]:
    """Points (V, 3) near the surface moved onto it, by a quarter of the `spacing` at most, and the surface's
    normals there (V, 3): fingers get round that cells almost as wide as they leave knobbly."""
    start, step = points, 0.7 * spacing
    ways = step * np.concatenate([np.eye(3), -np.eye(3)])
    while True:
        sides = _field_at(trunk, limbs, (points + ways[:, None]).reshape(-1, 3), spacing).reshape(6, -1)
        slope = ((sides[:3] - sides[3:]) / (2 * step)).T
        steep = np.linalg.norm(slope, axis=1, keepdims=True)
        if points is not start:
            return points, slope / np.maximum(steep, 1e-9)
        away = _field_at(trunk, limbs, points, spacing)[:, None] / np.maximum(steep, 0.5)
        points = start - np.clip(away, -0.25 * spacing, 0.25 * spacing) * slope / np.maximum(steep, 1e-9)


def _field_at(trunk: Group, limbs: Sequence[Group], points: Array, spacing: float) -> Array:
    """The field that `sampled` samples, at points (V, 3)."""
    body = _group_at(trunk, points, spacing)
    total = body.copy()
    for limb in limbs:
        near = _near([solid.box for solid in limb.solids], points, max(MARGIN * spacing, limb.softness))
        alone = _group_at(limb, points[near], spacing)
        total[near] = np.minimum(total[near], smooth_minimum(body[near], alone, limb.softness))
    return total


def _group_at(group: Group, points: Array, spacing: float) -> Array:
    field = np.full(len(points), FAR * spacing)
    for part in group.steps:
        near = _near([part.box], points, max(MARGIN * spacing, part.softness))
        sign = -1.0 if part.removes else 1.0
        new = part.distance(*points[near].T)
        field[near] = sign * smooth_minimum(sign * field[near], new, part.softness)
    return field


def _near(boxes: Sequence[tuple[Array, Array]], points: Array, around: float) -> NDArray[np.bool_]:
    low = np.min([box[0] for box in boxes], axis=0) - around
    high = np.max([box[1] for box in boxes], axis=0) + around
    inside: NDArray[np.bool_] = ((points >= low) & (points <= high)).all(axis=1)
    return inside


def perpendicular(side: Array, direction: Array) -> Array:
    """The side, turned perpendicular to a direction, unit length (3,); zero where the two are parallel."""
    rest = side - direction * float(side @ direction) / max(float(direction @ direction), 1e-12)
    length = float(np.linalg.norm(rest))
    unit: Array = rest / length if length > 1e-3 else np.zeros(3)
    return unit


def _make(group: Group, grid: Grid, field: NDArray[np.float32]) -> None:
    """Bring a group's steps into the field, in place."""
    for step in group.steps:
        near = _window([step.box], grid, step.softness)
        before = field[near]
        if before.size:
            new = step.distance(*_coordinates(grid, near))
            if step.removes:
                field[near] = -smooth_minimum(-before, new, step.softness)
            else:
                field[near] = smooth_minimum(before, new, step.softness)


def _part_of(grid: Grid, window: tuple[slice, slice, slice]) -> Grid:
    first = np.array([part.start for part in window])
    shape = [part.stop - part.start for part in window]
    return Grid(grid.origin + grid.spacing * first, grid.spacing, (shape[0], shape[1], shape[2]))


def _window(boxes: Sequence[tuple[Array, Array]], grid: Grid, softness: float) -> tuple[slice, slice, slice]:
    """The samples in boxes and so near to them that a volume there is felt; empty beyond the grid."""
    around = max(MARGIN * grid.spacing, softness)
    low = np.min([box[0] for box in boxes], axis=0) - around
    high = np.max([box[1] for box in boxes], axis=0) + around
    first = np.clip(np.floor((low - grid.origin) / grid.spacing).astype(int), 0, grid.shape)
    last = np.clip(np.ceil((high - grid.origin) / grid.spacing).astype(int) + 1, 0, grid.shape)
    x, y, z = (slice(int(a), int(b)) for a, b in zip(first, last, strict=True))
    return x, y, z


def _coordinates(grid: Grid, window: tuple[slice, slice, slice]) -> tuple[Array, Array, Array]:
    x, y, z = (grid.axis(number)[part] for number, part in enumerate(window))
    return x[:, None, None], y[None, :, None], z[None, None, :]


def _dot(x: Array, y: Array, z: Array, vector: Array) -> Array:
    total: Array = x * np.float32(vector[0]) + y * np.float32(vector[1]) + z * np.float32(vector[2])
    return total
