"""A lit figure: rounded cones met by parallel rays, in plain numpy.

View coordinates are metres to the right, upwards and towards the viewer; there is no perspective.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from appliance.pose.body import Cones
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array


def _unit(*v: float) -> Array:
    unit: Array = np.array(v) / np.linalg.norm(v)
    return unit


KEY_LIGHT = _unit(-0.55, 0.62, 0.56)
HALFWAY = _unit(*(KEY_LIGHT + np.array([0, 0, 1])))  # between the light and the eye: where it glosses
KEY = np.array([1.0, 0.94, 0.84])
SKY = np.array([0.30, 0.35, 0.46])
GROUND = np.array([0.20, 0.14, 0.12])
RIM = np.array([0.42, 0.58, 0.92])
SUPERSAMPLE = 2
_AROUND_M = 0.10  # as far as limbs take light from each other


@dataclass(frozen=True)
class Frame:
    """A picture of width x height pixels; the one at (x0, y0) from the top left shows the origin."""

    width: int
    height: int
    x0: float
    y0: float
    pixels_per_metre: float

    def rays(self, finer: int) -> tuple[Array, Array]:
        """Metres to the right (columns,) and upwards (rows,) of the centres of finer x finer subpixels."""
        columns = (np.arange(self.width * finer) + 0.5) / finer - self.x0
        rows = self.y0 - (np.arange(self.height * finer) + 0.5) / finer
        return columns / self.pixels_per_metre, rows / self.pixels_per_metre


def render(cones: Cones, colours: Array, frame: Frame) -> Array:
    """Picture (height, width, 4), alpha premultiplied, of cones in view coordinates; colours (C, 3) 0..1."""
    picture = np.zeros((frame.height, frame.width, 4))
    part, place = _around(cones, frame)
    if not (part.width and part.height):
        return picture
    right, up = part.rays(SUPERSAMPLE)
    depth = np.full((len(up), len(right)), -np.inf)
    normals = np.zeros((*depth.shape, 3))
    cone = np.zeros(depth.shape, np.int16)
    for number in range(len(cones.joint)):
        a, b = cones.start[number], cones.end[number]
        ra, rb = float(cones.start_radius[number]), float(cones.end_radius[number])
        low, high = np.minimum(a - ra, b - rb), np.maximum(a + ra, b + rb)
        columns = slice(*np.searchsorted(right, [low[0], high[0]]))
        rows = slice(*np.searchsorted(-up, [-high[1], -low[1]]))
        if columns.start == columns.stop or rows.start == rows.stop:
            continue
        near = depth[rows, columns]
        for met, reached, normal in _meet(right[None, columns], up[rows, None], a, b, ra, rb, near):
            near[met] = reached
            normals[rows, columns][met] = normal
            cone[rows, columns][met] = number
    if not (hit := np.isfinite(depth)).any():
        return picture
    lit = np.zeros((*depth.shape, 4))
    lit[hit, :3] = _shade(normals[hit], colours[cone[hit]]) * _openness(depth, part)[hit, None]
    lit[hit, 3] = 1.0
    parts = _subpixels(lit)
    picture[place] = functools.reduce(np.add, parts) / len(parts)
    return picture


def _subpixels(fine: Array) -> list[Array]:
    """The first subpixel of each pixel, the second of each, and so on. Much faster than an axis of them."""
    finer = range(SUPERSAMPLE)
    return [fine[row::SUPERSAMPLE, column::SUPERSAMPLE] for row in finer for column in finer]


def _around(cones: Cones, frame: Frame) -> tuple[Frame, tuple[slice, slice]]:
    """The part of a frame that the cones and what they darken can reach, and its rows and columns."""
    radius = np.maximum(cones.start_radius, cones.end_radius)[:, None]
    low = (np.minimum(cones.start, cones.end) - radius).min(axis=0) - 2 * _AROUND_M - 0.02
    high = (np.maximum(cones.start, cones.end) + radius).max(axis=0) + 2 * _AROUND_M + 0.02
    size, scale = (frame.width, frame.height), frame.pixels_per_metre
    left, right = (int(np.clip(frame.x0 + scale * x, 0, size[0])) for x in (low[0], high[0] + 1 / scale))
    top, bottom = (int(np.clip(frame.y0 - scale * y, 0, size[1])) for y in (high[1], low[1] - 1 / scale))
    part = Frame(right - left, bottom - top, frame.x0 - left, frame.y0 - top, scale)
    return part, (slice(top, bottom), slice(left, right))


def floor_shadow(cones: Cones, floor: float, lift: float, frame: Frame) -> Array:
    """Darkness (height, width) 0..1 that world cones (y up) throw on the floor; softer from higher up.

    The rows of the frame run over the floor: a metre of depth is `lift` metres of the picture.
    """
    right, up = frame.rays(1)
    deep = -up / lift
    darkness = np.zeros((len(deep), len(right)))
    for number in range(len(cones.joint)):
        ends = np.stack([cones.start[number], cones.end[number]])
        above = ends[:, 1] - floor
        (ax, az), (bx, bz) = thrown = ends[:, [0, 2]] + above[:, None] * np.array([0.30, -0.20])
        ra, rb = cones.start_radius[number], cones.end_radius[number]
        reach = max(ra, rb) + 0.03 + 0.22 * max(above.max(), 0)
        columns, rows = (
            slice(*np.searchsorted(axis, [both.min() - reach, both.max() + reach]))
            for axis, both in zip((right, deep), thrown.T, strict=True)
        )
        x, z = right[None, columns], deep[rows, None]
        length = (bx - ax) ** 2 + (bz - az) ** 2 + 1e-12
        along = np.clip(((x - ax) * (bx - ax) + (z - az) * (bz - az)) / length, 0, 1)
        distance = np.hypot(x - ax - along * (bx - ax), z - az - along * (bz - az))
        radius = ra * (1 - along) + rb * along
        softness = 0.03 + 0.22 * np.maximum(above[0] * (1 - along) + above[1] * along, 0)
        edge = np.clip((radius + softness - distance) / (2 * softness), 0, 1)
        strength = radius / (radius + 0.5 * softness)
        part = darkness[rows, columns]
        np.maximum(part, strength * ease(edge), out=part)
    return darkness


Met = tuple[Array, Array, Array]  # which rays (rows, columns), bool; their depths (P,) and normals (P, 3)


def _meet(x: Array, y: Array, a: Array, b: Array, ra: float, rb: float, behind: Array) -> Iterator[Met]:
    """Where rays along -z at x (1, columns) and y (rows, 1) meet a rounded cone in front of `behind`.

    The ray against the cone's side is a quadratic; the rounded ends are two spheres. The caller updates
    `behind` (rows, columns) after each item.
    """
    for centre, radius in ((a, ra), (b, rb)):
        dx, dy = x - centre[0], y - centre[1]
        inside = radius * radius - dx * dx - dy * dy
        met = inside > 0
        met[met] = centre[2] + np.sqrt(inside[met]) > behind[met]
        if met.any():
            dz = np.sqrt(inside[met])
            side = (np.broadcast_to(dx, met.shape)[met], np.broadcast_to(dy, met.shape)[met], dz)
            yield met, centre[2] + dz, np.stack(side, axis=-1) / radius
    bone = b - a
    m0, rr = float(bone @ bone), ra - rb
    d2 = m0 - rr * rr
    m2 = -float(bone[2])
    k2 = d2 - m2 * m2
    if d2 <= 1e-12 or abs(k2) < 1e-12:
        return
    far = max(a[2], b[2]) + ra + rb  # rays start here and run along -z
    dx, dy, dz = x - a[0], y - a[1], float(far - a[2])
    m1 = dx * bone[0] + (dy * bone[1] + dz * bone[2])
    k1 = (m2 * rr * ra - d2 * dz) - m2 * m1
    k0 = d2 * (dx * dx + (dy * dy + dz * dz)) + (2 * rr * ra - m1) * m1 - m0 * ra * ra
    h = k1 * k1 - k0 * k2
    met = h >= 0
    t = (-np.sqrt(h[met]) - k1[met]) / k2
    along = m1[met] - ra * rr + t * m2
    front = (along > 0) & (along < d2) & (far - t > behind[met])
    met[met] = front
    if not met.any():
        return
    t, along = t[front], along[front]
    rays = (np.broadcast_to(dx, met.shape)[met], np.broadcast_to(dy, met.shape)[met], dz - t)
    normal = d2 * np.stack(rays, axis=-1) - bone * along[:, None]
    yield met, far - t, normal / np.sqrt(np.einsum("ij,ij->i", normal, normal))[:, None]


def _shade(normal: Array, paint: Array) -> Array:
    """Colour (P, 3) of matt surfaces with a key light, sky and floor around, a cool rim and a soft gloss."""
    facing = normal @ KEY_LIGHT
    key = np.clip((facing + 0.25) / 1.25, 0, 1)[:, None] ** 1.4
    upward = (0.5 + 0.5 * normal[:, 1])[:, None]
    edge = np.clip(1 - normal[:, 2], 0, 1)[:, None]
    rim = edge * edge * edge * np.clip(0.35 + 0.65 * (normal @ _unit(0.8, 0.35, -0.3)), 0, 1)[:, None]
    gloss8 = np.clip(normal @ HALFWAY, 0, 1)[:, None] ** 8
    gloss = gloss8 * gloss8 * gloss8 * gloss8 * gloss8
    light = 0.95 * key * KEY + upward * SKY + (1 - upward) * GROUND
    colour: Array = np.clip(paint * light + 0.55 * rim * RIM + 0.16 * gloss * KEY, 0, 1)
    return colour


def _openness(depth: Array, frame: Frame) -> Array:
    """How much light reaches each subpixel past the parts in front of it, 0..1."""
    near = functools.reduce(np.maximum, _subpixels(depth))
    hit = np.isfinite(near)
    surface = np.where(hit, near, near[hit].min() - 0.3)
    openness = np.ones(near.shape)
    for metres, strength in ((0.03, 0.3), (_AROUND_M, 0.4)):
        around = surface
        for axis in (0, 1, 0, 1):
            around = _box_mean(around, max(1, round(metres * frame.pixels_per_metre)), axis)
        openness *= 1 - strength * np.clip((around - surface) / (2 * metres), 0, 1)
    return openness.repeat(SUPERSAMPLE, axis=0).repeat(SUPERSAMPLE, axis=1)


def _box_mean(values: Array, reach: int, axis: int) -> Array:
    """Mean over 2 * reach + 1 neighbours along an axis, the edges repeated."""
    padding = [(0, 0)] * values.ndim
    padding[axis] = (reach + 1, reach)
    sums = np.cumsum(np.pad(values, padding, mode="edge"), axis=axis)
    width = 2 * reach + 1
    count = values.shape[axis]
    upper = np.take(sums, np.arange(width, width + count), axis=axis)
    mean: Array = (upper - np.take(sums, np.arange(count), axis=axis)) / width
    return mean
