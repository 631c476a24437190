"""Does the hand move the body? Figures of a coder that dances as on stage with one joint held.

The phrase is a held-out take; the hand is the orientation of one joint over time in another take: true
orientations of the same dancer, unrelated to the phrase. 'Others': the moving joints that are not held. All
angles are mean joint angles in degrees, heading removed. The reference is all that the dancer did: the sound
poses of the training takes, without their mirror images. With mirror images, plausibility and fit_own of
three held-out takes come out 0 to 0.5 degrees lower, fit_bare 0.1 to 2.2 (most where few poses hold a joint
so): a puppet would seem to fit where only its mirror image did.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from appliance.dancer.puppeteers import TurningAxis
from appliance.studio.evaluation.comparison import Comparison
from appliance.studio.evaluation.measurement import Iterations, Measurement
from appliance.studio.evaluation.recorded import Recorded

ITERATIONS: tuple[Iterations, ...] = ((1, 1), (2, 1), (10, 9), (10, 10), (30, 29))
IN_PLAY: Iterations = (10, 9)  # at which the onset and turning hands are measured
FREE = (1, 10, 30, 100)
TURNING_TICKS = 500  # two turns of the slow hand
TURNING = tuple((axis, seconds) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)) for seconds in (1.0, 5.0))
LARGEST = ("largest_step", "snap")  # for several dances the maximum counts, not the mean


def measure(
    measurements: Sequence[Measurement],
    joints: Sequence[str],
    iterations: Sequence[Iterations] = ITERATIONS,
    free: Sequence[int] = FREE,
    advance: Callable[[str], None] = lambda _: None,
    turning: bool = True,
    recorded: Recorded | None = None,
) -> dict[str, Any]:
    """Keys JOINT.K_J, JOINT.turning, free.K, phrase with figures below them, JOINT.onset_ticks, .step_answer.

    recorded: also JOINT.baselines with the figures of comparison.py; at the iterations in play those of the
    network are among JOINT.K_J's too. Means over the pairs; turning hands on the first pair only.
    advance(description) is called before each dance, `dances` times in all.
    """
    in_play = usual_iterations(iterations)
    comparison = None if recorded is None else Comparison(measurements, recorded)
    found: dict[str, Any] = {}
    for joint in joints:
        figures: dict[str, Any] = {}
        for coding, interaction in iterations:
            rows, danced = [], []
            for one in measurements:
                advance(f"hand on {joint}, {coding}/{interaction}")
                danced.append(one.danced(joint, (coding, interaction), one.hand(joint)))
                rows.append(asdict(one.figures(danced[-1], coding)))
            figures[f"{coding}_{interaction}"] = _means(rows)
            if comparison is not None and (coding, interaction) == in_play:
                advance(f"hand on {joint}, beside phrase, pasted arm and motion matching")
                figures["baselines"] = comparison.of_joint(joint, danced)
                figures[f"{coding}_{interaction}"] |= {
                    name: value
                    for name, value in figures["baselines"]["network"].items()
                    if name not in rows[0]
                }
        advance(f"steps of a hand on {joint}")
        steps = [one.steps(joint, in_play) for one in measurements]
        known = [step.onset_ticks for step in steps if step.onset_ticks is not None]
        figures["onset_ticks"] = statistics.median(known) if known else None
        figures["step_answer"] = round(statistics.fmean(step.degrees for step in steps), 3)
        rows = []
        for axis, seconds in TURNING if turning else ():
            advance(f"a hand that turns {joint}")
            hand = TurningAxis(joint, axis, seconds)
            rows.append(asdict(measurements[0].with_hand(joint, in_play, hand, TURNING_TICKS)))
        if rows:
            figures["turning"] = _means(rows)
        found[joint] = figures
    found["free"] = {}
    for coding in free:
        advance(f"without a hand, {coding}")
        found["free"][str(coding)] = _means([one.free(coding) for one in measurements])
        if comparison is not None and coding in (in_play[0], max(free)):
            found["free"][str(coding)] |= comparison.of_free(coding)
    found["phrase"] = _means([one.of_phrase() for one in measurements])
    reference = measurements[0].reference
    found["reference"] = {"poses": len(reference), "largest_step": round(reference.largest_step, 3)}
    if comparison is not None:
        found["reference"] |= comparison.reference
    return found


def dances(
    pairs: int,
    joints: int,
    iterations: Sequence[Iterations] = ITERATIONS,
    free: Sequence[int] = FREE,
    compared: bool = False,
) -> int:
    """How often `measure` calls advance; compared: with recordings."""
    return joints * (pairs * len(iterations) + 1 + len(TURNING) + compared) + len(free)


def usual_iterations(iterations: Sequence[Iterations]) -> Iterations:
    """IN_PLAY if it is among these, else the largest."""
    return IN_PLAY if IN_PLAY in iterations else max(iterations)


def _means(rows: Sequence[dict[str, float]]) -> dict[str, float | None]:
    """Mean of each figure over the rows, or maximum of those in LARGEST; None if no row has it."""
    merged: dict[str, float | None] = {}
    for name in rows[0]:
        values = [row[name] for row in rows if math.isfinite(row[name])]
        whole = max if name in LARGEST else statistics.fmean
        merged[name] = round(whole(values), 3) if values else None
    return merged
