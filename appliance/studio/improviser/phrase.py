"""The phrase: the best stretch of several improvised dances, made endless."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from appliance.dancer.loop import turns_about_y, yaws
from appliance.dancer.material.carrying import smoothed
from appliance.dancer.material.improvising import MOVE
from appliance.dancer.material.steps import Steps, danced_again, motion_of
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.data.dataset import FPS, Dataset
from appliance.studio.improviser.footing import plant_feet
from appliance.studio.improviser.improvise_options import PhraseOptions
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.naturalness import Naturalness, Yardstick, measure
from appliance.studio.improviser.prompt import PRIMER, STEPS_S
from appliance.studio.improviser.steps import WindowCoder
from appliance.studio.improviser.stretches import best_stretches
from appliance.studio.studio_error import StudioError

_log = logging.getLogger(__name__)

SEAM_S = 0.8  # length of the crossfade from the end to the start
STAGE_M = 3.6  # width and depth of the root's path; arms and steps need the rest of 4 m
STROLL_FRAMES = 401  # slower motion than this is the way over the stage, not steps


def make_phrase(
    autoencoder: Autoencoder,
    improviser: Improviser,
    dataset: Dataset,
    recorded: Sequence[Steps],
    options: PhraseOptions,
) -> tuple[Recording, Naturalness]:
    """Improvise several dances, take the stretches that close best, make them endless, keep the best.

    recorded: stretches of the recordings; each dance continues one of them.
    """
    moving, still = dataset.moving, dataset.still_pose()
    coder = WindowCoder(autoencoder)
    dances = [_motion(coder, dance, dataset, still) for dance in improvise(improviser, recorded, options)]
    yardstick = Yardstick.of(dataset.training, moving)
    stretches = best_stretches(dances, yardstick, options.seconds, STAGE_M, SEAM_S, options.finalists)
    if not stretches:
        raise StudioError("No dance is long enough for the phrase. Ask for longer ones with --dance-minutes.")
    best: tuple[float, Recording, Naturalness] | None = None
    for number, stretch in enumerate(stretches, 1):
        closed = closed_loop(dances[stretch.dance], stretch.first, stretch.last)
        again = replace(closed, poses=danced_again(coder, closed.poses, moving, cyclic=True))
        phrase = on_stage(plant_feet(on_stage(again), options.settling))
        natural = measure(phrase, yardstick)
        _log.info(f"candidate {number} of {len(stretches)}: {verdict(natural)}")
        faults = faultiness(natural) + stretch.cost
        if best is None or faults < best[0]:
            best = faults, phrase, natural
    assert best is not None
    return best[1], best[2]


def improvise(improviser: Improviser, recorded: Sequence[Steps], options: PhraseOptions) -> list[Steps]:
    """Dances, each of which continues another recorded stretch. Raises StudioError without a long one."""
    rng = np.random.default_rng(options.seed)
    long = [stretch for stretch in recorded if len(stretch) >= PRIMER]
    if not long:
        raise StudioError(
            f"No recording has {PRIMER / STEPS_S:.1f} s without a capture error to go on from. Give the "
            "recordings that the improviser was trained on."
        )
    starts = []
    for number in rng.choice(len(long), options.dances, replace=len(long) < options.dances):
        first = int(rng.integers(len(long[number]) - PRIMER + 1))
        starts.append(torch.tensor(long[number].features[first : first + PRIMER]))
    moves = int(np.ceil(options.minutes * 60 * STEPS_S / MOVE))
    _log.info(f"improvising {options.dances} dances of {options.minutes:g} minutes")
    danced = improviser.improvise(torch.stack(starts), moves, options.temperature, options.seed)
    return [Steps.of_features(dance.numpy()) for dance in danced]


def _motion(coder: WindowCoder, steps: Steps, dataset: Dataset, still: Array) -> Recording:
    poses, roots = motion_of(coder, steps, still, dataset.moving)
    return Recording(dataset.skeleton, poses, roots, FPS)


def closed_loop(dance: Recording, first: int, last: int) -> Recording:
    """Frames first..last - 1 as a cycle: the frames after the last are crossfaded into the first ones.

    Crossfaded are the pose without heading, and the turning and displacement of each frame, so that neither
    place nor heading matters. The displacement and turning that then miss from a whole cycle are spread over
    all of it.
    """
    count, fade = last - first, round(SEAM_S * FPS)
    heading = np.unwrap(yaws(quaternion.heading(dance.poses[:, 0])))
    level = dance.poses.copy()
    level[:, 0] = quaternion.multiply(turns_about_y(-heading), level[:, 0])
    way = quaternion.rotate(turns_about_y(-heading[:-1]), np.diff(dance.roots, axis=0))
    turn = np.diff(heading)
    share = ease((np.arange(fade) + 0.5) / fade)

    def faded(values: Array) -> Array:
        cycle = values[first:last].copy()
        part = share.reshape(-1, *[1] * (values.ndim - 1))
        cycle[:fade] = (1 - part) * values[last : last + fade] + part * cycle[:fade]
        return cycle

    poses = level[first:last].copy()
    poses[:fade] = quaternion.slerp(level[last : last + fade], poses[:fade], share[:, None])
    turn = faded(turn)
    turn -= np.remainder(turn.sum() + np.pi, 2 * np.pi) / count - np.pi / count
    heading = np.concatenate([[0.0], np.cumsum(turn)])[:-1]
    step = quaternion.rotate(turns_about_y(heading), faded(way))
    step -= step.mean(axis=0)
    roots = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])[:-1]
    roots[:, 1] = faded(dance.roots[:, 1:2])[:, 0]
    poses[:, 0] = quaternion.multiply(turns_about_y(heading), poses[:, 0])
    return Recording(dance.skeleton, quaternion.continuous(poses), roots, dance.fps)


def on_stage(phrase: Recording) -> Recording:
    """The path centred on the stage, its slow part shrunk to fit; steps stay as they are."""
    roots = phrase.roots.copy()
    ground = roots[:, [0, 2]]
    stroll = smoothed(ground, min(STROLL_FRAMES, len(ground) // 2 * 2 - 1))
    steps = ground - stroll
    stroll -= (stroll.max(axis=0) + stroll.min(axis=0)) / 2
    for axis in range(2):
        shrink = 1.0
        while np.ptp(shrink * stroll[:, axis] + steps[:, axis]) > STAGE_M and shrink > 0.05:
            shrink *= 0.95
        stroll[:, axis] *= shrink
    ground = stroll + steps
    roots[:, [0, 2]] = ground - (ground.max(axis=0) + ground.min(axis=0)) / 2
    return replace(phrase, roots=roots)


def faultiness(natural: Naturalness) -> float:
    """One number to choose between candidates: 0 is like the recordings."""
    pace, recorded = natural.pace, natural.recorded_pace
    return float(
        2 * abs(np.log(natural.liveliness))
        + max(0.0, np.log(pace.jerk_p99 / recorded.jerk_p99))
        + max(0.0, np.log(pace.trembling / recorded.trembling))
        + max(0.0, pace.longest_still_s - 2.0)
        + max(0.0, np.log(natural.slide_cm_s / natural.recorded_slide_cm_s))
        + 2 * abs(np.log(natural.likeness.breadth))
        + natural.likeness.strangeness
    )


def verdict(natural: Naturalness) -> str:
    """The measures in one line for people."""
    pace, recorded, likeness, seam = natural.pace, natural.recorded_pace, natural.likeness, natural.seam
    joined = "" if seam is None else f", seam {seam.degrees:.1f} of {seam.around_degrees:.1f} degrees"
    wide, deep = natural.stage_m
    return (
        f"{natural.seconds:.1f} s, liveliness {natural.liveliness:.2f}, breadth {likeness.breadth:.2f}, "
        f"coverage {likeness.coverage:.2f}, "
        f"strangeness {likeness.strangeness:.2f}, jerk x{pace.jerk_p99 / recorded.jerk_p99:.2f}, "
        f"above 8 Hz {100 * pace.trembling:.2f} % (recorded {100 * recorded.trembling:.2f} %); "
        f"longest still {pace.longest_still_s:.1f} s, slide {natural.slide_cm_s:.0f} cm/s "
        f"(recorded {natural.recorded_slide_cm_s:.0f}), path {wide:.1f} x {deep:.1f} m{joined}"
    )
