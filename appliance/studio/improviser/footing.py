"""Footing: adjusts legs and root of a generated, endless phrase so that planted feet stand still."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from appliance.dancer.grounding import PLANTED_PERCENTILE, sole_positions
from appliance.dancer.material.carrying import carried, smoothed
from appliance.pose.recording import Recording

HEIGHT_SMOOTH_FRAMES = 7
Progress = Callable[[range], Iterable[int]]


def plant_feet(phrase: Recording, iterations: int = 250, progress: Progress = iter) -> Recording:
    """A cyclic phrase with planted feet held and nothing below the floor (at height 0).

    First the root: its height from the lowest sole, its speed against the slide of what carries it; then legs
    and root together by gradient descent through forward kinematics, the last frame leading into the first.
    """
    from appliance.studio.improviser.settled_legs import settled

    return settled(_grounded(carried(_grounded(phrase))), iterations, progress)


def _grounded(phrase: Recording) -> Recording:
    """The lowest sole on the floor."""
    points = sole_positions(phrase.skeleton, phrase.poses, phrase.roots)
    heights = points[..., 1] - points[..., 1].min(axis=1, keepdims=True)
    rest = np.percentile(heights, PLANTED_PERCENTILE, axis=0)
    lowest = (points[..., 1] - rest).min(axis=1)
    roots = phrase.roots.copy()
    roots[:, 1] -= smoothed(lowest, HEIGHT_SMOOTH_FRAMES)
    return replace(phrase, roots=roots)
