"""Onset: how long after a step of the hand half of the other joints' answer is out."""

from __future__ import annotations

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import WINDOW
from appliance.studio.evaluation.in_play import FollowedOrientation, Rehearsal
from appliance.studio.evaluation.motion_figures import degrees_apart
from appliance.studio.evaluation.nearest import without_heading

STEPS = 8  # evenly over the phrase
STEP_DEGREES = 60.0
AFTER = 24  # ticks: all windows that saw the old orientation have passed after 15
LEAST_DEGREES = 1.0  # others that move less between the two orientations do not answer: nothing to time


def onset_ticks(rehearsal: Rehearsal, joint: str, turns: Array, iterations: tuple[int, int]) -> float | None:
    """Median over several steps of the hand, from one of its orientations (N, 4) to another.

    The dance with the step is compared with those in which the hand stays at the one or at the other: half of
    the answer is out when it is nearer to the other. 0: in the tick of the step. None: no answer.
    """
    room = len(rehearsal.windows) - AFTER
    begins = np.linspace(0, room - WINDOW, STEPS).astype(int) if room >= WINDOW else np.zeros(0, dtype=int)
    found = [_onset(rehearsal, joint, *_two(turns, begin), int(begin), iterations) for begin in begins]
    known = [ticks for ticks in found if ticks is not None]
    return float(np.median(known)) if known else None


def _two(turns: Array, number: int) -> tuple[Array, Array]:
    """An orientation of the hand and one about STEP_DEGREES away."""
    one = turns[number % len(turns)]
    away = np.degrees(quaternion.angle_between(turns, one))
    return one, turns[int(np.abs(away - STEP_DEGREES).argmin())]


def _onset(
    rehearsal: Rehearsal, joint: str, one: Array, other: Array, begin: int, iterations: tuple[int, int]
) -> int | None:
    ticks = WINDOW + AFTER
    part = slice(begin, begin + ticks)
    others = [place for place, name in enumerate(rehearsal.coder.joints) if name != joint]
    paths = (
        np.tile(one, (ticks, 1)),
        np.tile(other, (ticks, 1)),
        np.concatenate([np.tile(one, (WINDOW, 1)), np.tile(other, (AFTER, 1))]),
    )
    stays, goes, steps = (
        without_heading(
            rehearsal.held(*iterations, FollowedOrientation(joint, quaternion.continuous(path)), part)[0]
        )[:, others]
        for path in paths
    )
    if degrees_apart(stays, goes)[-AFTER // 2 :].mean() < LEAST_DEGREES:
        return None
    gone, left = degrees_apart(steps, stays)[1:], degrees_apart(steps, goes)[1:]  # from the step's tick on
    return int((gone >= left).argmax())
