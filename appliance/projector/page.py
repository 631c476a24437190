"""Text over the picture for technicians: figures, corner numbers, which projector this is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.projector.corners import Corners
from appliance.projector.info import letters

GROUND, LETTER = 128, 255  # under letters the picture is darker; 0 leaves it as it is
_INWARD = ((1, 1), (-1, 1), (-1, -1), (1, -1))  # from each corner of the picture
_AWAY = 10  # pixels of the page, from a corner to the middle of its number: clear of the ring around it

Image = NDArray[np.uint8]


def page(size: tuple[int, int], lines: tuple[str, ...], corners: Corners | None, part: str) -> Image:
    """(height, width) in pixels of letters. lines: at the top left; corners: numbered where they lie, as
    shares of the page, with `part` in their middle; None: they are not."""
    width, height = size
    image = np.zeros((height, width), np.uint8)
    if corners is not None:
        places = np.array(corners) * size
        for number, (place, inward) in enumerate(zip(places, np.array(_INWARD), strict=True), start=1):
            _write(image, (str(number),), place + _AWAY * inward)
        if part:
            _write(image, (part,), places.mean(axis=0))
    if lines:
        _write(image, lines, np.zeros(2))
    return image


def _write(image: Image, lines: tuple[str, ...], middle: NDArray[np.float64]) -> None:
    """Write around this place, moved onto the page."""
    written = letters(lines)[: image.shape[0], : image.shape[1]]
    room = np.array(image.shape) - written.shape
    top, left = np.clip(np.round(middle[::-1] - np.array(written.shape) / 2), 0, room).astype(int)
    spot = image[top : top + written.shape[0], left : left + written.shape[1]]
    spot[:] = np.where(written > 0, LETTER, GROUND)
