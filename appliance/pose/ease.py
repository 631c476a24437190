"""The cubic ease: from 0 to 1 without a jolt at either end."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_Share = TypeVar("_Share", "float", "NDArray[np.float32]", "NDArray[np.float64]")


def ease(share: _Share) -> _Share:
    """A share 0..1, or many: 0..1 with slope 0 at both ends, known as smoothstep."""
    return share * share * (3 - 2 * share)
