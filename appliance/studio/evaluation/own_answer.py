"""The answer of a newly trained dancer, measured on its own takes in about a minute, for its report."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from appliance.pose.roles import held_joints
from appliance.studio.data.dataset import FPS, WINDOW, Dataset
from appliance.studio.evaluation import puppetry
from appliance.studio.evaluation.answer_picture import draw_answer
from appliance.studio.evaluation.coders import Coder
from appliance.studio.evaluation.dancer_verdict import Learned
from appliance.studio.evaluation.measurement import Iterations, Measurement, Pair
from appliance.studio.evaluation.nearest import reference_of
from appliance.studio.evaluation.onset import CODED_WINDOWS
from appliance.studio.evaluation.pairs import own_takes
from appliance.studio.evaluation.puppetry_report import judged
from appliance.studio.evaluation.recorded import Recorded
from appliance.studio.progress import reported
from appliance.studio.studio_error import StudioError

PARTS = ("left upper arm", "left forearm", "head")
ITERATIONS: tuple[Iterations, ...] = ((2, 1), (10, 9))
FREE = (1, 10, 30)
BUDGET_S = 30.0  # for coding; search, grounding and picture take about as long
MOST_TICKS, FEWEST_TICKS = 600, 150
SIZES = ((2, 3), (1, 3), (1, 1))  # pairs and joints: fewer for a slow network


def own_answer(
    coder: Coder,
    dataset: Dataset,
    picture: Path,
    one_pass_error: float | None = None,
    steps: int | None = None,
    console: Console | None = None,
) -> dict[str, Any]:
    """The figures of puppetry.measure, and cause, verdict, advice, measured_on; draws a picture.

    one_pass_error: degrees off the recordings after one pass without a hand; steps: of training. Never
    fails: if nothing can be measured, not_measured gives the reason, and there is no picture.
    """
    picture.unlink(missing_ok=True)
    try:
        takes = own_takes(dataset)
        reference = reference_of(takes.reference, coder.joints)
        named = held_joints(coder.joints)
        joints = [named[part] for part in PARTS if part in named] or list(named.values())[: len(PARTS)]
        if not joints:
            raise StudioError(
                "none of the joints that it moves is called arm, head, chest or thigh. Name one: bunraku "
                "evaluate with --hands, --reference and --joint."
            )
    except StudioError as error:
        return {"not_measured": str(error)}
    size = fitting_size(coder, len(takes.pairs), len(joints))
    pairs = [_beginning(pair, size.ticks) for pair in takes.pairs[: size.pairs]]
    measurements = [Measurement(coder, pair, reference) for pair in pairs]
    recorded = Recorded(takes.reference, coder.joints)
    with reported(console) as advance:
        found = puppetry.measure(
            measurements, joints[: size.joints], ITERATIONS, FREE, advance, turning=False, recorded=recorded
        )
    draw_answer(picture, measurements[0], joints[0], puppetry.IN_PLAY)
    return {
        **found,
        "measured_on": takes.description,
        **judged(found, learned(dataset, steps), one_pass_error),
    }


def learned(dataset: Dataset, steps: int | None) -> Learned:
    """The training's facts for the verdict."""
    minutes = sum(take.recording.seconds for take in dataset.training) / 60
    return Learned(minutes, len({take.take for take in dataset.training}), steps)


@dataclass(frozen=True)
class Size:
    pairs: int
    joints: int
    ticks: int


def fitting_size(coder: Coder, pairs: int, joints: int) -> Size:
    """The largest measurement that the network codes within the budget."""
    affordable = BUDGET_S / _seconds_a_pass(coder)
    ticks = FEWEST_TICKS
    for most_pairs, most_joints in SIZES:
        size = min(pairs, most_pairs), min(joints, most_joints)
        dances = size[0] * (size[1] * sum(k for k, _ in ITERATIONS) + sum(FREE))
        steps = size[0] * size[1] * CODED_WINDOWS * puppetry.IN_PLAY[0]
        ticks = int((affordable - steps) / dances)
        if ticks >= MOST_TICKS // 2:
            break
    return Size(*size, min(max(ticks, FEWEST_TICKS), MOST_TICKS))


def _seconds_a_pass(coder: Coder) -> float:
    """Cost of one iteration of one window."""
    count = min(coder.batch, 64)
    windows = np.tile(coder.rest.astype(np.float32), (count, WINDOW, 1, 1))
    coder.iterate(windows, 1)
    began = time.perf_counter()
    coder.iterate(windows, 5)
    return (time.perf_counter() - began) / (5 * count)


def _beginning(pair: Pair, ticks: int) -> Pair:
    seconds = (ticks + WINDOW - 1) / FPS
    return replace(pair, phrase=pair.phrase.excerpt(0, seconds), hand=pair.hand.excerpt(0, seconds))
