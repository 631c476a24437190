"""The step response: how far the other joints follow a step of the hand, and after how many ticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.data.dataset import WINDOW
from appliance.studio.evaluation.dance_figures import degrees_apart
from appliance.studio.evaluation.in_play import FollowedOrientation, Rehearsal
from appliance.studio.evaluation.nearest import without_heading

STEPS = 8  # evenly over the phrase
STEP_DEGREES = 60.0
AFTER = 24  # ticks: after 15, all windows that saw the old orientation have passed
CODED_WINDOWS = STEPS * 3 * (WINDOW + AFTER)  # what it costs
LEAST_DEGREES = 1.0  # if the others move less, they do not answer, and there is nothing to time


@dataclass(frozen=True)
class StepAnswer:
    """Response to several steps of a hand by STEP_DEGREES.

    degrees: how far the others move from the hand's one orientation to the other (mean). onset_ticks: ticks
    until half of that is reached (median), 0: in the tick of the step; None if nothing answers.
    """

    degrees: float
    onset_ticks: float | None


def answer_to_steps(
    rehearsal: Rehearsal, joint: str, turns: Array, iterations: tuple[int, int]
) -> StepAnswer:
    """Steps from one of the hand's orientations (N, 4) to another, spread over the phrase.

    The dance with the step is compared with two in which the hand stays at one orientation: half of the
    answer is out when it is nearer to the dance at the new one.
    """
    room = len(rehearsal.windows) - AFTER
    begins = np.linspace(0, room - WINDOW, STEPS).astype(int) if room >= WINDOW else np.zeros(0, dtype=int)
    found = [_step(rehearsal, joint, *_two(turns, begin), int(begin), iterations) for begin in begins]
    known = [ticks for _, ticks in found if ticks is not None]
    degrees = float(np.mean([degrees for degrees, _ in found])) if found else 0.0
    return StepAnswer(degrees, float(np.median(known)) if known else None)


def _two(turns: Array, number: int) -> tuple[Array, Array]:
    """An orientation of the hand and one about STEP_DEGREES away."""
    one = turns[number % len(turns)]
    away = np.degrees(quaternion.angle_between(turns, one))
    return one, turns[int(np.abs(away - STEP_DEGREES).argmin())]


def _step(
    rehearsal: Rehearsal, joint: str, one: Array, other: Array, begin: int, iterations: tuple[int, int]
) -> tuple[float, int | None]:
    """Degrees between the two orientations' dances, and ticks until half of them are out."""
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
    degrees = float(degrees_apart(stays, goes)[-AFTER // 2 :].mean())
    if degrees < LEAST_DEGREES:
        return degrees, None
    gone, left = degrees_apart(steps, stays)[1:], degrees_apart(steps, goes)[1:]  # from the step's tick on
    return degrees, int((gone >= left).argmax())
