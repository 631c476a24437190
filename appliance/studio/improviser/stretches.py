"""Stretches: the parts of several dances whose end is closest to their start, with few other faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.improviser.naturalness import Yardstick, distances, figure_shapes

EVERY = 4  # frames; ends are looked for at each of these
STARTS_EVERY = 2  # in poses
SHORTEST, LONGEST = 0.9, 1.1  # share of the wanted length
PACE_S = 0.1  # a joint's speed counts in distances as its displacement in this time
APART_S = 5.0  # finalists from one dance begin at least this far apart
ENDS_EACH = 2  # ends that are considered for each start
GAP, PACE, OVER_M, DRIFT_M = 2.0, 1.0, 0.2, 0.05  # weights of the faults; strangeness weighs 1


@dataclass(frozen=True)
class Stretch:
    """Frames first..last of a dance; cost: how far its end is from its start, and its other faults."""

    dance: int
    first: int
    last: int
    cost: float


def best_stretches(
    dances: Sequence[Recording],
    yardstick: Yardstick,
    seconds: float,
    stage_m: float,
    seam_s: float,
    finalists: int,
) -> list[Stretch]:
    """The best stretches, best first, of about `seconds`, each followed by seam_s more of its dance."""
    found = [
        stretch
        for number, dance in enumerate(dances)
        for stretch in _stretches(number, dance, yardstick, seconds, stage_m, seam_s)
    ]
    found.sort(key=lambda stretch: stretch.cost)
    kept: list[Stretch] = []
    for stretch in found:
        if len(kept) == finalists:
            break
        apart = APART_S * dances[stretch.dance].fps
        if all(stretch.dance != k.dance or abs(stretch.first - k.first) > apart for k in kept):
            kept.append(stretch)
    return kept


def _stretches(
    number: int, dance: Recording, yardstick: Yardstick, seconds: float, stage_m: float, seam_s: float
) -> list[Stretch]:
    if dance.seconds < SHORTEST * seconds + seam_s:
        return []
    rate = dance.fps / EVERY
    shapes = figure_shapes(dance, yardstick.moving)[::EVERY]
    path = dance.roots[::EVERY, [0, 2]]
    pace = np.gradient(shapes, axis=0) * rate
    whole = np.concatenate([shapes, pace * PACE_S], axis=1)
    parts = np.array_split(shapes, max(1, len(shapes) // 500))
    strange = np.concatenate([yardstick.strangeness(part) for part in parts])
    speed = np.linalg.norm(pace, axis=1)
    beyond = len(shapes) - round(seam_s * rate) - 1
    lengths = np.arange(round(SHORTEST * seconds * rate), round(LONGEST * seconds * rate) + 1)
    found = []
    for first in range(2, beyond - int(lengths[0]), STARTS_EVERY):
        lasts = first + lengths[first + lengths < beyond]
        gaps = distances(whole[first : first + 1], whole[lasts])[0] / yardstick.usual_cm
        for at in np.argsort(gaps)[:ENDS_EACH]:
            inside = slice(first, int(lasts[at]))
            cost = (
                GAP * gaps[at]
                + strange[inside].mean()
                + PACE * abs(np.log(speed[inside].mean() / yardstick.shape_speed))
                + _room(path[first : inside.stop + 1], stage_m)
            )
            found.append(Stretch(number, EVERY * first, EVERY * inside.stop, float(cost)))
    return found


def _room(path: Array, stage_m: float) -> float:
    """Cost of a closed path (N, 2) that needs more room than the stage has, or misses its start."""
    miss = path[-1] - path[0]
    closed = path - np.linspace(0, 1, len(path))[:, None] * miss
    over = np.maximum(np.ptp(closed, axis=0) - stage_m, 0).sum()
    return float(OVER_M * over + DRIFT_M * np.linalg.norm(miss))
