"""A critic: how well a small network tells half a second of a dance from half a second of the dancer.

The area under its curve, on takes that it did not learn from: 0.5 if it cannot tell, 1 if it always can. A
classifier two-sample test (Lopez-Paz and Oquab 2017), with the area in place of the accuracy. Noise of 2
degrees on each joint hides what no audience sees: rounding, blending, interpolation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array

POSES = np.array([0, 6, 12, 18, 24])  # ticks of the poses that it sees: half a second
LENGTH = int(POSES[-1]) + 1
EVERY = 2  # ticks between two half seconds
NOISE_DEGREES = 2.0
PACE_NOISE = 0.25  # on the logarithm of speed and acceleration
GAP = 50  # ticks between what it learns and what it is asked, where both are of one take
SIZES, STEPS, BATCH, RATE, DECAY, DROPPED, BLUR = (64, 32), 400, 256, 2e-3, 0.05, 0.3, 0.1
PASSES, FEWEST_STEPS = 30, 40  # so often it sees each row; few rows need few steps, 3,500 all
LEAST_ROWS = 20

Floats = NDArray[np.float32]


def critic(
    recorded: Sequence[Array],
    danced: Sequence[Array],
    joints: Sequence[int],
    takes: Sequence[str],
    moving: bool = False,
    seed: int = 0,
) -> float:
    """Mean area under the curve over the takes, each left out of learning once.

    recorded, danced: poses (T, M, 4), headings removed, one pair for each of takes. joints: those that it
    sees. takes: pairs of one name are left out together; a single take is halved in time, with a gap of a
    second. moving: it also sees how fast and how jerky each joint is. NaN if the dances are too short.
    """
    rng = np.random.default_rng(seed)
    places = list(joints)
    groups = list(dict.fromkeys(takes))
    if len(groups) == 1:
        recorded, danced, takes = _halves(recorded), _halves(danced), [*"ab"] * len(recorded)
        groups = ["a", "b"]
    real = [critic_rows(poses[:, places], rng, moving) for poses in recorded]
    made = [critic_rows(poses[:, places], rng, moving) for poses in danced]
    areas = []
    for group in groups:
        parts = [
            np.concatenate([rows for rows, take in zip(side, takes, strict=True) if (take == group) == asked])
            for asked in (False, True)
            for side in (real, made)
        ]
        if min(map(len, parts)) < LEAST_ROWS:
            return float("nan")
        tells = _learned(parts[0], parts[1], rng)
        areas.append(area_under_curve(tells(parts[2]), tells(parts[3])))
    return float(np.mean(areas))


def area_under_curve(real: Array, made: Array) -> float:
    """Probability that a score of `made` (m,) is above one of `real` (n,): Mann and Whitney's U / (n m)."""
    scores = np.concatenate([real, made])
    _, places, counts = np.unique(scores, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(counts) - (counts - 1) / 2)[places]  # ties share their mean rank
    n, m = len(real), len(made)
    return float(1.0 - (ranks[:n].sum() - n * (n + 1) / 2) / (n * m))


def critic_rows(poses: Array, rng: np.random.Generator, moving: bool = False) -> Floats:
    """(N, D): half seconds of poses (T, M, 4), headings removed, as the critic sees them.

    Rotations are the first two columns of their matrices (Zhou et al. 2019).
    """
    starts = np.arange(0, max(0, len(poses) - LENGTH + 1), EVERY)
    seen = poses[starts[:, None] + POSES]
    half = np.radians(NOISE_DEGREES) / 2 * rng.standard_normal((*seen.shape[:-1], 3))
    shaken = quaternion.normalize(np.concatenate([np.ones((*seen.shape[:-1], 1)), half], axis=-1))
    six = quaternion.to_6d(quaternion.multiply(seen, shaken))
    rows = six.reshape(len(starts), len(POSES) * 6 * poses.shape[1])
    if moving and len(starts):
        speed, jerkiness = _pace(poses, starts)
        rows = np.concatenate(
            [rows, *(part + PACE_NOISE * rng.standard_normal(part.shape) for part in (speed, jerkiness))],
            1,
        )
    return rows.astype(np.float32)


def _pace(poses: Array, starts: NDArray[np.intp]) -> tuple[Array, Array]:
    """(N, M) each: logarithm of each joint's mean speed and mean acceleration over the half seconds."""
    turns = quaternion.multiply(poses[1:], quaternion.inverse(poses[:-1]))
    axes, angles = quaternion.to_axis_angle(turns)
    velocities = axes * np.degrees(angles)[..., None]
    speeds = np.linalg.norm(velocities, axis=-1)
    accelerations = np.linalg.norm(np.diff(velocities, axis=0), axis=-1)

    def means(values: Array, ticks: int) -> Array:
        summed = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        mean: Array = (summed[starts + ticks] - summed[starts]) / ticks
        return mean

    return np.log(means(speeds, LENGTH - 1) + 0.05), np.log(means(accelerations, LENGTH - 2) + 0.02)


def _halves(dances: Sequence[Array]) -> list[Array]:
    """Beginning and end of each dance, the gap between them left out."""
    parts = []
    for poses in dances:
        middle = len(poses) // 2
        parts += [poses[: max(0, middle - GAP // 2)], poses[middle + GAP // 2 :]]
    return parts


def _learned(real: Floats, made: Floats, rng: np.random.Generator) -> Callable[[Floats], Floats]:
    """A perceptron of two hidden layers that learned to score `made` rows above `real` ones."""
    rows = np.concatenate([real, made])
    wanted = np.concatenate([np.zeros(len(real)), np.ones(len(made))]).astype(np.float32)[:, None]
    mean, deviation = rows.mean(axis=0), rows.std(axis=0) + np.float32(1e-3)
    rows = (rows - mean) / deviation
    sizes = (rows.shape[1], *SIZES, 1)
    layers = []
    for inputs, outputs in pairwise(sizes):
        bound = 1 / np.sqrt(inputs)
        layers += [
            rng.uniform(-bound, bound, shape).astype(np.float32) for shape in ((inputs, outputs), (outputs,))
        ]
    first, second = [np.zeros_like(layer) for layer in layers], [np.zeros_like(layer) for layer in layers]
    blur = BLUR * rng.standard_normal((4 * BATCH, rows.shape[1]), dtype=np.float32)
    for step in range(1, min(STEPS, max(FEWEST_STEPS, PASSES * len(rows) // BATCH)) + 1):
        chosen, shift = rng.integers(len(rows), size=BATCH), rng.integers(3 * BATCH)
        seen = rows[chosen] + blur[shift : shift + BATCH]
        kept = (rng.random((BATCH, SIZES[0])) >= DROPPED).astype(np.float32) / np.float32(1 - DROPPED)
        for place, gradient in enumerate(_gradients(layers, seen, wanted[chosen], kept)):
            first[place] += np.float32(0.1) * (gradient - first[place])
            second[place] += np.float32(0.001) * (gradient**2 - second[place])
            pace = first[place] / (1 - 0.9**step) / (np.sqrt(second[place] / (1 - 0.999**step)) + 1e-8)
            layers[place] -= RATE * (pace + DECAY * layers[place])

    def tells(asked: Floats) -> Floats:
        return _hidden(layers, (asked - mean) / deviation)[-1][:, 0]

    return tells


def _hidden(
    layers: Sequence[Floats], rows: Floats, kept: Floats | float = 1.0
) -> tuple[Floats, Floats, Floats]:
    """Both hidden layers and the score (N, 1)."""
    once = np.maximum(rows @ layers[0] + layers[1], 0) * kept
    twice = np.maximum(once @ layers[2] + layers[3], 0)
    return once, twice, twice @ layers[4] + layers[5]


def _gradients(layers: Sequence[Floats], rows: Floats, wanted: Floats, kept: Floats) -> list[Floats]:
    """Gradient of the binary cross-entropy, for weights and biases of each layer."""
    once, twice, score = _hidden(layers, rows, kept)
    at_score = (1 / (1 + np.exp(-np.clip(score, -30, 30))) - wanted) / len(rows)
    at_twice = (at_score @ layers[4].T) * (twice > 0)
    at_once = (at_twice @ layers[2].T) * (once > 0) * kept
    return [
        rows.T @ at_once,
        at_once.sum(axis=0),
        once.T @ at_twice,
        at_twice.sum(axis=0),
        twice.T @ at_score,
        at_score.sum(axis=0),
    ]
