"""How well a motion stands on the floor: float, penetration and slide of its feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appliance.dancer.grounding import Floor, sole_positions
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton


@dataclass(frozen=True)
class Standing:
    """How well a motion stands: means over its frames, and the worst frames."""

    float_cm: float
    worst_float_cm: float
    penetration_cm: float
    worst_penetration_cm: float
    slide_cm_s: float
    worst_slide_cm_s: float  # 95th percentile


def measure_standing(
    skeleton: Skeleton,
    poses: Array,
    roots: Array,
    floor: Floor,
    lifts: Array | None = None,
    fps: float = 50.0,
) -> Standing:
    """Measure poses (N, J, 4) with roots (N, 3) metres against a phrase's floor.

    Float and penetration: how far the lowest point of the soles is above or below its place (lifts (N,)
    metres above the floor, 0 if not given). Slide: horizontal speed of a point that is the lowest in two
    successive frames, outside jumps.
    """
    points = sole_positions(skeleton, poses, roots)
    clearances = points[..., 1] - floor.rest_heights
    wanted = np.zeros(len(poses)) if lifts is None else lifts
    off = clearances.min(axis=-1) - wanted
    lowest = clearances.argmin(axis=-1)
    planted = np.flatnonzero((lowest[1:] == lowest[:-1]) & (wanted[1:] == 0) & (wanted[:-1] == 0))
    carrying = lowest[planted]
    steps = (points[planted + 1, carrying] - points[planted, carrying])[:, [0, 2]]
    slides = np.linalg.norm(steps, axis=-1) * fps if len(planted) else np.zeros(1)
    above, below = np.maximum(off, 0), np.maximum(-off, 0)
    return Standing(
        100 * float(above.mean()),
        100 * float(above.max()),
        100 * float(below.mean()),
        100 * float(below.max()),
        100 * float(slides.mean()),
        100 * float(np.percentile(slides, 95)),
    )
