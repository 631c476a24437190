"""Quaternion maths as free functions over any leading shape; order w, x, y, z, right-handed, Y up.

Shapes are written (..., 4). Nothing here keeps state and nothing changes its arguments.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating[Any]]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32)

# Left multiplication a*b as a matrix of a's components: row r, column c is SIGN[r, c] * a[INDEX[r, c]].
_LEFT_INDEX = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_LEFT_SIGN = np.array([[1, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]], dtype=np.float32)
# Right multiplication by a's inverse in the same form: together they turn a vector, q*v*q^-1.
_RIGHT_INVERSE_SIGN = np.array(
    [[1, 1, 1, 1], [-1, 1, -1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1]], dtype=np.float32
)
_CONJUGATE = np.array([1, -1, -1, -1], dtype=np.float32)


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product a*b, (..., 4) x (..., 4) -> (..., 4): turn by b first, then by a."""
    left = np.take(a, _LEFT_INDEX, axis=-1) * _LEFT_SIGN
    product: Array = np.matmul(left, b[..., None])[..., 0]
    return product


def inverse(q: Array) -> Array:
    """Inverse of a unit quaternion (its conjugate), (..., 4)."""
    conjugate: Array = q * _CONJUGATE
    return conjugate


def normalize(q: Array) -> Array:
    """Unit length; a quaternion of length zero becomes the identity."""
    length = np.sqrt(np.sum(q * q, axis=-1, keepdims=True))
    safe = np.where(length > 1e-12, q, IDENTITY.astype(q.dtype))
    unit: Array = safe / np.where(length > 1e-12, length, np.ones_like(length))
    return unit


def rotate(q: Array, vectors: Array) -> Array:
    """Turn vectors (..., 3) by unit quaternions (..., 4)."""
    turned: Array = np.matmul(to_matrix(q), vectors[..., None])[..., 0]
    return turned


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    left = np.take(q, _LEFT_INDEX, axis=-1) * _LEFT_SIGN
    right = np.take(q, _LEFT_INDEX, axis=-1) * _RIGHT_INVERSE_SIGN
    product: Array = np.matmul(left, right)
    return product[..., 1:, 1:]


def from_matrix(matrix: Array) -> Array:
    """Unit quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3); the largest component leads."""
    m = np.asarray(matrix)
    diagonal = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], axis=-1)
    trace = diagonal.sum(axis=-1)
    squared = np.stack(
        [1 + trace, *(1 + 2 * diagonal[..., k] - trace for k in range(3))], axis=-1
    )  # 4w^2, 4x^2, 4y^2, 4z^2
    wx, wy, wz = (m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1])
    xy, xz, yz = (m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2])
    candidates = np.stack(
        [
            np.stack([squared[..., 0], wx, wy, wz], axis=-1),
            np.stack([wx, squared[..., 1], xy, xz], axis=-1),
            np.stack([wy, xy, squared[..., 2], yz], axis=-1),
            np.stack([wz, xz, yz, squared[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    leading = np.argmax(squared, axis=-1)
    q = np.take_along_axis(candidates, leading[..., None, None], axis=-2)[..., 0, :]
    q = normalize(q)
    return np.where(q[..., :1] < 0, -q, q)


def slerp(a: Array, b: Array, t: ArrayLike) -> Array:
    """Spherical interpolation the short way, a at t = 0, b at t = 1; t broadcasts against (...,)."""
    share = np.asarray(t, dtype=np.result_type(a, b))[..., None]
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    angle = np.arccos(np.minimum(np.abs(cosine), 1.0))
    sine = np.sin(angle)
    near = sine < 1e-5  # so close that a straight line is exact to float precision
    divisor = np.where(near, 1.0, sine)
    weight_a = np.where(near, 1 - share, np.sin((1 - share) * angle) / divisor)
    weight_b = np.where(near, share, np.sin(share * angle) / divisor)
    return normalize(weight_a * a + np.where(cosine < 0, -weight_b, weight_b) * b)


def blend(quaternions: Array, weights: ArrayLike) -> Array:
    """Weighted mean of (N, ..., 4) with weights (N,), signs aligned to the first; unit length.

    The normalised weighted sum: the first step of Markley et al. 2007, exact for two equal weights and
    within 0.1 degrees of the true mean for rotations that lie within 40 degrees of each other.
    """
    q = aligned(quaternions, quaternions[:1])
    return normalize(np.tensordot(np.asarray(weights, dtype=q.dtype), q, axes=(0, 0)))


def angle_between(a: Array, b: Array) -> Array:
    """Angle of the rotation from a to b in radians, 0..pi, (..., 4) x (..., 4) -> (...,)."""
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    angle: Array = 4 * np.arcsin(np.minimum(chord / 2, 1.0))
    return angle


def from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Rotation by angle (radians) about axis (..., 3), of any length but zero."""
    direction = np.asarray(axis, dtype=np.float64)
    direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    half = np.asarray(angle, dtype=np.float64)[..., None] / 2
    shape = np.broadcast_shapes(direction.shape[:-1], half.shape[:-1])
    return np.concatenate(
        [np.broadcast_to(np.cos(half), (*shape, 1)), np.broadcast_to(np.sin(half) * direction, (*shape, 3))],
        axis=-1,
    )


def to_axis_angle(q: Array) -> tuple[Array, Array]:
    """Unit axis (..., 3) and angle 0..pi radians (...,); the axis of no rotation is x."""
    signed = np.where(q[..., :1] < 0, -q, q)
    length = np.linalg.norm(signed[..., 1:], axis=-1, keepdims=True)
    axis = np.where(length > 1e-12, signed[..., 1:] / np.where(length > 1e-12, length, 1.0), [1.0, 0.0, 0.0])
    angle: Array = 2 * np.arctan2(length[..., 0], signed[..., 0])
    return axis, angle


def to_6d(q: Array) -> Array:
    """First two columns of the rotation matrix, (..., 6) (Zhou et al. 2019, continuous representation)."""
    matrix = to_matrix(q)
    return np.concatenate([matrix[..., :, 0], matrix[..., :, 1]], axis=-1)


def from_euler(angles: Array, axes: str) -> Array:
    """Rotation of angles (..., len(axes)) in radians about axes such as 'zxy', applied as in BVH: z*x*y."""
    q: Array = np.broadcast_to(IDENTITY.astype(np.float64), (*angles.shape[:-1], 4))
    for column, axis in enumerate(axes):
        half = angles[..., column] / 2
        turn = np.zeros((*half.shape, 4))
        turn[..., 0], turn[..., 1 + "xyz".index(axis)] = np.cos(half), np.sin(half)
        q = multiply(q, turn)
    return q


def to_euler_zxy(q: Array) -> Array:
    """Angles (..., 3) in radians about z, x, y with q = z*x*y; at gimbal lock y takes no part."""
    m = to_matrix(q)
    sine = np.clip(m[..., 2, 1], -1.0, 1.0)
    locked = np.abs(sine) > 1 - 1e-9
    z = np.where(locked, np.arctan2(m[..., 1, 0], m[..., 0, 0]), np.arctan2(-m[..., 0, 1], m[..., 1, 1]))
    y = np.where(locked, 0.0, np.arctan2(-m[..., 2, 0], m[..., 2, 2]))
    return np.stack([z, np.arcsin(sine), y], axis=-1)


def aligned(q: Array, reference: Array) -> Array:
    """The same rotations with signs that bring them into the reference's hemisphere."""
    return np.where(np.sum(q * reference, axis=-1, keepdims=True) < 0, -q, q)


def sides(q: Array, reference: Array) -> Array:
    """1 or -1, (..., 1): the signs with which `aligned` multiplies; for those that keep them."""
    signs: Array = np.copysign(1.0, np.einsum("...k,...k->...", q, reference))[..., None]
    return signs


def continuous(q: Array, axis: int = 0) -> Array:
    """The same rotations with no sign jump from one step to the next along an axis."""
    steps = np.moveaxis(np.asarray(q), axis, 0)
    dots = np.einsum("...k,...k->...", steps[1:], steps[:-1])[..., None]
    flips = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0).astype(steps.dtype)
    return np.moveaxis(np.concatenate([steps[:1], steps[1:] * flips], axis=0), 0, axis)


def heading(q: Array) -> Array:
    """The part of a world rotation that turns about the vertical (+Y): its twist, (..., 4), w >= 0.

    Upside down (w = y = 0) no heading exists; the identity is returned.
    """
    twist = q * np.array([1, 0, 1, 0], dtype=np.asarray(q).dtype)
    twist = normalize(twist)
    return np.where(twist[..., :1] < 0, -twist, twist)
