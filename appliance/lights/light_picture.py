"""Light as a camera in haze sees it: beams in the air, pools on the floor, what reaches a place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.lights.beams import SPOT, Beam
from appliance.pose.quaternion import Array

# Chosen by eye: at full level and 4 m a pool is bright and a beam in the air half as bright.
_SURFACE, _HAZE = 18.0, 0.8
_NEAREST_M = 0.35  # light does not grow without limit towards the lamp
_SAMPLES = 16  # along each line of sight through a beam
_SPOT_CORE = 0.8  # a spot is even up to here, and soft at its edge; all else fades from the middle


class Space(NamedTuple):
    """The drawn part of the stage, metres: two opposite corners."""

    low: Array
    high: Array


def haze(beams: Sequence[Beam], space: Space, right: int, up: int, shape: tuple[int, int]) -> Array:
    """Light (rows, columns, 3), linear, that the air of the space scatters towards a viewer.

    right, up: the axes that the picture shows; rows run along `up`, from low to high. Lines of sight are
    parallel to the third axis and end at the walls of the space.
    """
    depth = 3 - right - up
    x, y = (_centres(space, axis, count) for axis, count in ((right, shape[1]), (up, shape[0])))
    light = np.zeros((*shape, 3))
    for beam in beams:
        if beam.level <= 0.0:
            continue
        inside, near, far, across = _chords(beam, x[None, :], y[:, None], space, (right, up, depth))
        scattered = np.zeros(len(near))
        way = float(beam.direction[depth])
        for sample in range(_SAMPLES):
            along = near + (far - near) * (sample + 0.5) / _SAMPLES
            scattered += _intensity(beam, across[0] + along**2, across[1] + along * way)
        light[inside] += _power(beam) * _HAZE * (scattered * (far - near) / _SAMPLES)[:, None]
    return light


def on_floor(beams: Sequence[Beam], x: Array, z: Array) -> Array:
    """Light (rows, columns, 3), linear, on the floor at x (columns,) and z (rows,) metres: soft ellipses."""
    points = np.stack(np.broadcast_arrays(x[None, :], 0.0, z[:, None]), axis=-1)
    light = np.zeros(points.shape)
    for beam, reached, distance2 in _reached(beams, points):
        slant = np.clip(beam.place[1], 0.0, None) / np.sqrt(distance2)
        light += _power(beam) * _SURFACE * (reached * slant)[..., None]
    return light


def reaching(beams: Sequence[Beam], points: Array) -> Array:
    """Light (..., 3), linear, that reaches places (..., 3), from whichever side."""
    light = np.zeros(points.shape)
    for beam, reached, _ in _reached(beams, points):
        light += _power(beam) * _SURFACE * reached[..., None]
    return light


def shown(light: Array) -> Array:
    """Linear light as colours of a screen, 0..1: the brightest nears white, nothing is cut off."""
    exposed = 1.0 - np.exp(-light)
    colours: Array = np.where(exposed <= 0.0031308, 12.92 * exposed, 1.055 * exposed ** (1 / 2.4) - 0.055)
    return colours


def _power(beam: Beam) -> Array:
    """Its colour, (3,), as linear light. A beam twice as wide is half as dense: halfway to the same lamp with
    another lens, which would leave a wide one unseen beside a narrow one."""
    wide = np.tan(np.radians(20.0)) / np.tan(np.radians(beam.degrees / 2))
    power: Array = beam.level * np.asarray(beam.colour, float) ** 2.2 * wide
    return power


def _intensity(beam: Beam, distance2: Array, along: Array) -> Array:
    """Share of its power at squared distances, so far along its axis (both metres): 0 at its edge."""
    edge = np.tan(np.radians(beam.degrees / 2))
    ahead = np.maximum(along, 1e-6)
    outwards = np.clip((distance2 / ahead**2 - 1.0) / edge**2, 0.0, 1.0)  # squared: 0 axis, 1 edge
    if beam.kind == SPOT:
        ramp = np.clip((1.0 - np.sqrt(outwards)) / (1.0 - _SPOT_CORE), 0.0, 1.0)
        profile = ramp**2 * (3.0 - 2.0 * ramp)
    else:
        profile = (1.0 - outwards) ** 2
    reached: Array = np.where(along > 0.0, profile, 0.0) / np.maximum(distance2, _NEAREST_M**2)
    return reached


def _reached(beams: Sequence[Beam], points: Array) -> Iterator[tuple[Beam, Array, Array]]:
    for beam in beams:
        if beam.level > 0.0:
            way = points - beam.place
            distance2 = np.einsum("...i,...i", way, way)
            yield beam, _intensity(beam, distance2, way @ beam.direction), distance2


def _chords(
    beam: Beam, x: Array, y: Array, space: Space, axes: tuple[int, int, int]
) -> tuple[NDArray[np.bool_], Array, Array, tuple[Array, Array]]:
    """Where lines of sight at x (1, columns) and y (rows, 1) cross a beam's cone within the space.

    Returns which of them do (rows, columns). Of these: the depths at which they enter and leave the cone,
    metres from the lamp's own; and at the lamp's depth the squared distance to it, and the distance along its
    axis. The cone is a quadratic in the depth.
    """
    right, up, depth = axes
    across, upwards = x - beam.place[right], y - beam.place[up]
    distance2 = across**2 + upwards**2
    ahead = across * beam.direction[right] + upwards * beam.direction[up]
    way, cosine2 = float(beam.direction[depth]), np.cos(np.radians(beam.degrees / 2)) ** 2
    a = way**2 - cosine2
    a = a if abs(a) > 1e-6 else -1e-6
    b, c = ahead * way, ahead**2 - cosine2 * distance2
    root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    first, second = (-b + root) / a, (-b - root) / a  # a < 0: in order
    if a > 0:  # it points along the line of sight: in at one side, out at the wall
        far_off = np.full_like(first, np.inf)
        first, second = (
            (np.maximum(first, second), far_off) if way > 0 else (-far_off, np.minimum(first, second))
        )
    front, back = (float(one[depth] - beam.place[depth]) for one in space)
    near, far = np.clip(first, front, back), np.clip(second, front, back)
    inside = (far - near > 1e-9) & (ahead + 0.5 * (near + far) * way > 0.0)
    return inside, near[inside], far[inside], (distance2[inside], ahead[inside])


def _centres(space: Space, axis: int, count: int) -> Array:
    """The middle of each of `count` pixels between two walls, metres."""
    centres: Array = space.low[axis] + (space.high[axis] - space.low[axis]) * (np.arange(count) + 0.5) / count
    return centres
