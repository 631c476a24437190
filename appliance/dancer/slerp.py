"""SLERP of many quaternions into preallocated arrays: the tick's twin of quaternion.slerp."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]

# Below this cosine of 1 the angle's sine would vanish; there the weights are those of a straight line anyway.
_ALMOST_ONE = np.float32(1 - 2**-23)


class Slerp:
    """Interpolates count pairs of unit quaternions; 15 numpy calls, nothing allocated.

    It goes the short way, or (short False) the way that the signs say: between two motions that drift more
    than half a turn apart, the short way would jump from one side to the other. The result is in a's
    hemisphere and has unit length as exactly as its inputs (1e-6): no normalising.
    """

    def __init__(self, count: int, *, short: bool = True) -> None:
        self._short = short
        self._cosine, self._angle, self._sine, self._share_a, self._share_b = np.empty(
            (5, count), dtype=np.float32
        )
        self._columns = self._share_a[:, None], self._share_b[:, None]
        self._part = np.empty((count, 4), dtype=np.float32)

    def __call__(self, a: FloatArray, b: FloatArray, t: FloatArray | float, out: FloatArray) -> None:
        """out = a at t = 0, b at t = 1 (with its sign aligned to a's where it goes the short way).

        a, b, out (count, 4), t (count,) or a number; out may be a.
        """
        angle, sine, share_a, share_b = self._angle, self._sine, self._share_a, self._share_b
        np.einsum("nk,nk->n", a, b, out=self._cosine)
        if self._short:
            np.abs(self._cosine, out=angle)
            np.minimum(angle, _ALMOST_ONE, out=angle)
        else:
            np.clip(self._cosine, -_ALMOST_ONE, _ALMOST_ONE, out=angle)
        np.arccos(angle, out=angle)
        np.sin(angle, out=sine)
        np.multiply(angle, t, out=share_b)
        np.subtract(angle, share_b, out=share_a)
        np.sin(share_a, out=share_a)
        np.sin(share_b, out=share_b)
        if self._short:
            np.copysign(share_b, self._cosine, out=share_b)
        np.divide(share_a, sine, out=share_a)
        np.divide(share_b, sine, out=share_b)
        column_a, column_b = self._columns
        np.multiply(b, column_b, out=self._part)
        np.multiply(a, column_a, out=out)
        np.add(out, self._part, out=out)
