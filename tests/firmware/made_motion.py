"""Made motion of an arm as an inertial unit measures it, and what the authors' VQF makes of it.

`python -m tests.firmware.made_motion` renews tests/golden/vqf.json; it needs the package `vqf` from PyPI.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
GOLDEN = Path(__file__).parents[1] / "golden" / "vqf.json"
RATE_HZ, EVERY = 240, 2  # rates a second; an acceleration with every second of them
MINUTES = 10
GOLDEN_EVERY_S = 15
BIAS_DEGREES_S = (0.6, -0.4, 0.3)
GRAVITY = 9.81


def measured() -> tuple[Floats, Floats]:
    """Rates, rad/s, shape (samples, 3), and accelerations, m/s^2, (samples / EVERY, 3): ten minutes of dance.

    The arm turns by up to 400 degrees/s and stands still for four seconds of every minute. The rates have a
    bias, both have noise; nothing is drawn at random.
    """
    seconds = np.arange(MINUTES * 60 * RATE_HZ) / RATE_HZ
    dances = np.convolve(seconds % 60 >= 4, np.ones(RATE_HZ // 2) / (RATE_HZ // 2), "same")[:, None]
    rates = 1.6 * _sines(seconds, (0.11, 0.37, 0.9, 1.7), 1.0) * dances
    pushed = 1.5 * _sines(seconds, (0.5, 1.3, 2.1), 2.0) * dances
    force = _into_body(_integrated(rates), pushed + np.array([0, 0, GRAVITY]))
    rates = rates + np.radians(BIAS_DEGREES_S) + np.radians(0.1) * _noise(seconds, 1)
    return rates, (force + 0.03 * _noise(seconds, 2))[EVERY - 1 :: EVERY]


def by_the_authors(rates: Floats, accelerations: Floats) -> Floats:
    """Orientation after each rate (w, x, y, z) from PyPI's `vqf`. Raises ImportError without it."""
    from vqf import VQF  # type: ignore[import-not-found, unused-ignore]

    fusion = VQF(1 / RATE_HZ, EVERY / RATE_HZ, -1.0)
    orientations = np.empty((len(rates), 4))
    for at, rate in enumerate(rates):
        fusion.updateGyr(np.ascontiguousarray(rate))
        if (at + 1) % EVERY == 0:
            fusion.updateAcc(np.ascontiguousarray(accelerations[at // EVERY]))
        orientations[at] = fusion.getQuat6D()
    return orientations


def _sines(seconds: Floats, frequencies: tuple[float, ...], seed: float) -> Floats:
    """Three sums of sines with fixed amplitudes and phases."""
    sums = np.zeros((len(seconds), 3))
    for axis in range(3):
        for number, frequency in enumerate(frequencies):
            phase = seed * 7.0 + 2.399 * (axis * len(frequencies) + number)
            sums[:, axis] += np.cos(1.7 * phase) * np.sin(2 * np.pi * frequency * seconds + phase)
    return sums


def _noise(seconds: Floats, seed: int) -> Floats:
    """Even between -1 and 1, the same each time."""
    numbers = np.arange(3 * len(seconds), dtype=np.uint64).reshape(-1, 3) + np.uint64(seed << 40)
    numbers = numbers * np.uint64(0x9E3779B97F4A7C15)
    numbers ^= numbers >> np.uint64(29)
    numbers = numbers * np.uint64(0xBF58476D1CE4E5B9)
    return (numbers >> np.uint64(11)).astype(np.float64) / (1 << 52) - 1


def _integrated(rates: Floats) -> Floats:
    orientations = np.empty((len(rates), 4))
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    norms = np.linalg.norm(rates, axis=1)
    halves = norms / RATE_HZ / 2
    along = np.sinc(halves / np.pi)[:, None] * rates / RATE_HZ / 2
    for at, (a, (b, c, d)) in enumerate(zip(np.cos(halves), along, strict=True)):
        w, x, y, z = (
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        )
        orientations[at] = w, x, y, z
    return orientations / np.linalg.norm(orientations, axis=1)[:, None]


def _into_body(orientations: Floats, world: Floats) -> Floats:
    w, axis = orientations[:, :1], -orientations[:, 1:]
    turned: Floats = world + 2 * np.cross(axis, np.cross(axis, world) + w * world)
    return turned


def main() -> None:
    orientations = by_the_authors(*measured())[:: GOLDEN_EVERY_S * RATE_HZ]
    GOLDEN.write_text(json.dumps({"orientations": np.round(orientations, 6).tolist()}, indent=1) + "\n")


if __name__ == "__main__":
    main()
