"""Carrying: the root's path changed so that feet that carry slide less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appliance.dancer.grounding import PLANTED_PERCENTILE, sole_positions
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

LOW_M = 0.04  # a point of the sole higher than this is in the air
SLOW_M_S = 0.35  # a point at this speed is half planted
SMOOTH_FRAMES = 9  # smoothing of the changes to legs and root: none is quicker than a step


def carried(phrase: Recording, cyclic: bool = True) -> Recording:
    """The root's path changed so that planted points slide less; a cycle's still ends where it began."""
    points = sole_positions(phrase.skeleton, phrase.poses, phrase.roots)
    rest = np.percentile(points[..., 1], PLANTED_PERCENTILE, axis=0)
    weight = planted(points, rest, phrase.fps)[..., None]
    step = (np.roll(points, -1, axis=0) - points)[..., [0, 2]]
    slide = (weight * step).sum(axis=1) / (weight.sum(axis=1) + 0.3)
    offset = np.cumsum(-smoothed(slide, SMOOTH_FRAMES), axis=0)
    count = len(phrase)
    if cyclic:
        offset -= offset[-1] * (np.arange(1, count + 1) / count)[:, None]
    roots = phrase.roots.copy()
    roots[1:, [0, 2]] += offset[:-1]
    return replace(phrase, roots=roots)


def planted(points: Array, rest: Array, fps: float) -> Array:
    """How firmly each point of the soles (N, S) is planted, 0..1, by its height and speed in a cycle.

    points (N, S, 3) metres; rest (S,): its height when planted.
    """
    velocity = (np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0))[..., [0, 2]] * fps / 2
    slow = 1 / (1 + (np.linalg.norm(velocity, axis=-1) / SLOW_M_S) ** 2)
    low = np.clip(1 - (points[..., 1] - rest) / LOW_M, 0, 1)
    return smoothed(slow * low, 5)


def smoothed(values: Array, frames: int) -> Array:
    """Hann-weighted mean over `frames` frames of a cycle, along the first axis."""
    weights = np.hanning(frames + 2)[1:-1]
    weights /= weights.sum()
    shifts = range(-(frames // 2), frames - frames // 2)
    total: Array = sum(w * np.roll(values, s, axis=0) for w, s in zip(weights, shifts, strict=True))
    return total
