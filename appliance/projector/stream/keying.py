"""Alpha for pictures of light on black: as much as they shine."""

from __future__ import annotations

import numpy as np


def keyed(pixels: bytes) -> bytes:
    """Pixels of four bytes as red, green, blue, alpha: alpha is the brightest colour, and colours are full.

    Laid over black they are the picture again; over another picture they are light before it.
    """
    picture = np.frombuffer(pixels, np.uint8).reshape(-1, 4).copy()
    alpha = picture[:, :3].max(axis=1)
    full = 255.0 / np.maximum(alpha, 1).astype(np.float32)
    picture[:, :3] = np.round(picture[:, :3] * full[:, None])
    picture[:, 3] = alpha
    return picture.tobytes()
