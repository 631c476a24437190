"""Noise that repeats without a seam: the grain of plaster, paper, floor, haze and brush."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SIDE = 256


def noise_pixels() -> bytes:
    """(SIDE, SIDE, 4) bytes: red soft clouds, green finer ones, blue fibres along x, alpha fine grain."""
    layers = [_clouds(1, 1.8, 1.0), _clouds(2, 1.2, 1.0), _clouds(3, 1.0, 12.0), _clouds(4, 0.0, 1.0)]
    return np.stack(layers, axis=-1).tobytes()


def _clouds(seed: int, fall: float, stretch: float) -> NDArray[np.uint8]:
    """Noise whose amplitude falls with frequency**fall, stretched along x; even in value from 0 to 255."""
    kx, ky = np.fft.fftfreq(SIDE)[None, :] * SIDE * stretch, np.fft.fftfreq(SIDE)[:, None] * SIDE
    spectrum = np.maximum(np.hypot(kx, ky), 1.0) ** -fall
    spectrum[0, 0] = 0.0
    white = np.fft.fft2(np.random.RandomState(seed).standard_normal((SIDE, SIDE)))
    values = np.fft.ifft2(white * spectrum).real
    values = 0.5 + 0.21 * values / values.std()
    return np.asarray(np.clip(values * 255, 0, 255), np.uint8)
