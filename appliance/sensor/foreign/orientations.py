"""Orientations as programs send them, in the sensor's axes: quaternions, angles, matrices.

The sensor's axes are right-handed, for the room and for the case: z up, x to the front in the neutral pose,
y to the left. A convention is renamed axis by axis in both; a left-handed one is mirrored too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from appliance.pose.turns import Vector, about, multiplied, swing
from appliance.sensor.state import Orientation

_UNIT = 0.1
_AXES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Convention:
    """Axes of a program: which of its axes are the sensor's x, y and z, and its usual front."""

    places: tuple[int, int, int]
    signs: tuple[int, int, int]
    front: str

    def to_sensor(self, orientation: Orientation) -> Orientation:
        """A rotation in the sensor's axes."""
        w, *turn = orientation
        (a, b, c), (sign_a, sign_b, sign_c), hand = self.places, self.signs, self._handedness
        return w, hand * sign_a * turn[a], hand * sign_b * turn[b], hand * sign_c * turn[c]

    def direction(self, axis: str) -> Vector:
        """An axis of the program, like 'z' or '-x', in the sensor's axes."""
        sign, values = (-1.0 if axis.startswith("-") else 1.0), _AXES[axis[-1]]
        x, y, z = (sign * one * values[place] for place, one in zip(self.places, self.signs, strict=True))
        return x, y, z

    @property
    def _handedness(self) -> int:
        """1 for right-handed axes, -1 for left-handed ones: the determinant of the renaming."""
        is_even = self.places in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        return math.prod(self.signs) * (1 if is_even else -1)


CONVENTIONS = {
    "z-up": Convention((0, 1, 2), (1, 1, 1), "x"),  # phones, x-IMU3, ROS
    "y-up": Convention((2, 0, 1), (1, 1, 1), "z"),  # TouchDesigner, Max, mocopi
    "unity": Convention((2, 0, 1), (1, -1, 1), "z"),  # y up, left-handed: Unity, VMC
}


def facing_front(facing: Vector) -> Orientation:
    """The rotation that brings the sensor's x axis to a unit axis of the case, by the shortest way."""
    return swing(_AXES["x"], facing)


def _from_xyzw(values: Sequence[float]) -> Orientation:
    x, y, z, w = values
    return w, x, y, z


def _from_wxyz(values: Sequence[float]) -> Orientation:
    w, x, y, z = values
    return w, x, y, z


def _from_euler(values: Sequence[float]) -> Orientation:
    """Degrees about x, y and z of the case, turned about z first, then y, then x: yaw, pitch, roll."""
    x, y, z = map(math.radians, values)
    return multiplied(multiplied(about(_AXES["z"], z), about(_AXES["y"], y)), about(_AXES["x"], x))


def from_device_angles(alpha: float, beta: float, gamma: float) -> Orientation:
    """Degrees of a browser's DeviceOrientationEvent: about z, then x, then y of the phone (W3C, 2024)."""
    z, x, y = map(math.radians, (alpha, beta, gamma))
    return multiplied(multiplied(about(_AXES["z"], z), about(_AXES["x"], x)), about(_AXES["y"], y))


def _from_matrix(values: Sequence[float]) -> Orientation:
    """A rotation matrix row by row, case to room. Raises ValueError where it turns nothing."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = values
    squares = (1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz)
    greatest = max(range(4), key=lambda place: squares[place])
    if not squares[greatest] > _UNIT:
        raise ValueError("This matrix is no rotation.")
    s = 2.0 * math.sqrt(squares[greatest])
    w, x, y, z = (
        (s / 4, (zy - yz) / s, (xz - zx) / s, (yx - xy) / s),
        ((zy - yz) / s, s / 4, (xy + yx) / s, (xz + zx) / s),
        ((xz - zx) / s, (xy + yx) / s, s / 4, (yz + zy) / s),
        ((yx - xy) / s, (xz + zx) / s, (yz + zy) / s, s / 4),
    )[greatest]
    return w, x, y, z


FORMS: dict[str, tuple[int, Callable[[Sequence[float]], Orientation]]] = {
    "xyzw": (4, _from_xyzw),
    "wxyz": (4, _from_wxyz),
    "euler": (3, _from_euler),
    "matrix": (9, _from_matrix),
}


def read_orientation(form: str, arguments: Sequence[object]) -> Orientation:
    """The unit orientation in the last numbers of a message. Raises ValueError with one clear sentence."""
    count, convert = FORMS[form]
    numbers = [float(one) for one in arguments if isinstance(one, int | float)]
    if len(numbers) < count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{count} finite numbers were expected ({form}), and {len(numbers)} came.")
    w, x, y, z = convert(numbers[-count:])
    length = math.hypot(w, x, y, z)
    if not abs(length - 1.0) < _UNIT:
        raise ValueError(f"A rotation has the length 1, and {length:.3g} came ({form}).")
    return w / length, x / length, y / length, z / length
