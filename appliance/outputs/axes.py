"""A receiver's axes: which of the box's axes (right-handed, Y up) become its x, y and z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_PLACES = {"x": 0, "y": 1, "z": 2}


def turn_of(axes: Sequence[str]) -> NDArray[np.float32]:
    """(3, 3): a row of the box's x, y, z times this is a row of the receiver's."""
    turn = np.zeros((3, 3), np.float32)
    for column, axis in enumerate(axes):
        turn[_PLACES[axis[-1]], column] = -1.0 if axis.startswith("-") else 1.0
    return turn
