"""Places and turns of MVR (millimetres, z up, y upstage) in the stage's axes (metres, y up, z downstage)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Placed = tuple[Array, Array]  # rotation (3, 3) and origin (3,), from an object's axes into those of the rig

UNMOVED: Placed = (np.eye(3), np.zeros(3))
_STAGE_FROM_RIG = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# A fixture is drawn hanging, seen from the audience (DIN SPEC 15800): its base is up, its beam down (-z). A
# head's own axes have y from its base along the beam, and z where it tilts: about x, from -z to y.
_DRAWN_FROM_OWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_UPSIDE_DOWN = np.diag([-1.0, -1.0, 1.0])


def placed(outer: Placed, rows: Sequence[Sequence[float]]) -> Placed:
    """An object inside another one, by its matrix in MVR: rows u, v, w (its axes) and o (its origin).

    Raises ValueError for a matrix that is not a rotation, scaled or not.
    """
    numbers = np.array([list(row)[:3] for row in rows], float)
    axes = numbers[:3].T
    lengths = np.linalg.norm(axes, axis=0)
    if numbers.shape != (4, 3) or not np.isfinite(numbers).all() or lengths.min() < 1e-6:
        raise ValueError("its matrix has no direction")
    rotation = axes / lengths
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-2 or np.linalg.det(rotation) < 0.0:
        raise ValueError("its matrix is skewed or mirrored")
    return outer[0] @ rotation, outer[0] @ numbers[3] + outer[1]


def on_stage(
    where: Placed,
) -> tuple[tuple[float, ...], Literal["hanging", "standing"], tuple[float, ...]]:
    """Place in metres, pose, and turn (yaw, pitch, roll in degrees) as a show writes them."""
    rotation = _STAGE_FROM_RIG @ where[0] @ _DRAWN_FROM_OWN
    is_standing = bool(rotation[1, 1] > 0.0)
    turned = rotation if is_standing else rotation @ _UPSIDE_DOWN
    pitch = np.arcsin(np.clip(-turned[1, 2], -1.0, 1.0))
    if np.cos(pitch) > 1e-6:
        yaw, roll = np.arctan2(turned[0, 2], turned[2, 2]), np.arctan2(turned[1, 0], turned[1, 1])
    else:
        yaw, roll = np.arctan2(-turned[2, 0], turned[0, 0]), 0.0
    place = tuple(round(float(part), 3) + 0.0 for part in _STAGE_FROM_RIG @ where[1] / 1000.0)
    turn = tuple(round(float(angle), 2) + 0.0 for angle in np.degrees([yaw, pitch, roll]))
    return place, "standing" if is_standing else "hanging", turn
