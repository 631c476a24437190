"""Figures that the field uses of a dance's body in space: jerk, foot skating, physical foot contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.pose.quaternion import Array

SKATE_FPS, SKATE_HEIGHT_M, SKATE_STEP_M = 20.0, 0.05, 0.025
CONTACT_FPS, CONTACT_S = 30.0, 5.0


def jerk(positions: Array, fps: float) -> float:
    """Mean length of the third derivative of positions (T, J, 3) over poses and joints, m/s3."""
    if len(positions) < 4:
        return float("nan")
    third = np.diff(positions.astype(np.float64), n=3, axis=0) * fps**3
    return float(np.linalg.norm(third, axis=-1).mean())


def foot_skate_ratio(soles: Sequence[Array], heights: Sequence[Array], fps: float) -> float:
    """Share of frames at 20 fps in which a foot below 5 cm moves by more than 2.5 cm.

    After GMD (Karunratanakul et al. 2023). soles: points (T, S, 3) of each foot, metres; heights (T, S): over
    where they stand. A foot is where its lowest point is, and low in both of two successive frames.
    """
    skates = []
    for points, above in zip(soles, heights, strict=True):
        frames = at_rate(np.concatenate([points, above[..., None]], axis=-1), fps, SKATE_FPS)
        if len(frames) < 2:
            return float("nan")
        lowest = frames[1:, :, 3].argmin(axis=1)[:, None, None]
        now, before = (np.take_along_axis(part, lowest, axis=1)[:, 0] for part in (frames[1:], frames[:-1]))
        moved = np.linalg.norm((now - before)[:, [0, 2]], axis=-1)
        skates.append((np.maximum(now[:, 3], before[:, 3]) < SKATE_HEIGHT_M) & (moved > SKATE_STEP_M))
    return float(np.any(skates, axis=0).mean()) if skates else float("nan")


def physical_foot_contact(roots: Array, soles: Sequence[Array], fps: float) -> float:
    """PFC of EDGE (Tseng et al. 2023, eval_pfc.py), times 10,000: mean over stretches of 5 s at 30 fps.

    A body accelerates only where a foot stands: acceleration of the root (vertically only its upward part) by
    the largest one, times the steps of both feet. roots (T, 3), soles (T, S, 3) of each foot, metres.
    """
    hips, feet = at_rate(roots, fps, CONTACT_FPS), [at_rate(foot, fps, CONTACT_FPS) for foot in soles]
    length = round(CONTACT_S * CONTACT_FPS)
    scores = [
        _contact(hips[begin : begin + length], [foot[begin : begin + length] for foot in feet])
        for begin in range(0, max(1, len(hips) - length + 1), length)
        if len(hips) > 3 and feet
    ]
    return 1e4 * float(np.mean(scores)) if scores else float("nan")


def _contact(hips: Array, feet: Sequence[Array]) -> float:
    accelerations = np.diff(hips, n=2, axis=0) * CONTACT_FPS**2
    accelerations[:, 1] = np.maximum(accelerations[:, 1], 0)
    product = np.linalg.norm(accelerations, axis=-1)
    product /= max(float(product.max()), 1e-9)
    for foot in feet:
        product = product * np.linalg.norm(np.diff(foot[1:], axis=0)[..., [0, 2]], axis=-1).min(axis=-1)
    return float(product.mean())


def at_rate(values: Array, fps: float, rate: float) -> Array:
    """Values (T, ...) at another rate, straight between frames."""
    at = np.arange(0, len(values) - 1 + 1e-9, fps / rate)
    before = np.minimum(at.astype(int), max(0, len(values) - 2))
    share = (at - before).reshape(-1, *[1] * (values.ndim - 1))
    after = np.minimum(before + 1, len(values) - 1)
    mixed: Array = (1 - share) * values[before].astype(np.float64) + share * values[after]
    return mixed
