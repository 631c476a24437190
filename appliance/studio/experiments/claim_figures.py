"""The measures behind the paper's claims: what each is about, in figures, for one trial.

Degrees are mean joint angles, heading removed. 'Others': the joints that the hand does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.evaluation import dance_figures as motion
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.nearest import Reference, without_heading
from appliance.studio.experiments.families import NUDGE_DEGREES, TURNS_S, Trial

PAUSE_SHARE = 0.3  # fraction of the dance's own mean speed: below it a body nearly stands still
STANDS_STILL = 1e-3  # degrees in all
OWN_POSE = 8.0  # degrees from a pose of the excerpt: nearly that pose
NO_ANSWER = 0.02  # degrees for each degree of the hand: below it nothing answers
EXACT = 7  # excerpts of which all permutations are tried: 5,040
PERMUTATIONS = 5000

SLOW, QUICK = f"{TURNS_S[1]:g}s", f"{TURNS_S[0]:g}s"


def faithfulness(trial: Trial, passes: int) -> dict[str, float]:
    """Degrees from the excerpt, and the same as a share of how far the excerpt is from the mean pose."""
    phrase = without_heading(trial.once.phrase)
    mean = np.broadcast_to(without_heading(trial.once.coder.rest), phrase.shape)
    degrees = _apart(without_heading(trial.dance("coding", (passes, 0)).poses), phrase)
    return {"degrees": degrees, "way_to_mean": _ratio(degrees, _apart(mean, phrase))}


def intermittency(trial: Trial) -> dict[str, float]:
    """Pauses and jumps after ten passes, against one pass and the excerpt.

    Both are measured by the dance's own mean speed, so that neither a slower nor a smaller dance has more of
    them. more_pauses: share of ticks. half_in: share of ticks, the quickest, that hold half of the motion.
    sharper: in how much fewer ticks that is. jumps: the speed in those ticks by the excerpt's in its own.
    """
    phrase = without_heading(trial.once.phrase)
    one, ten = (without_heading(trial.dance("coding", (passes, 0)).poses) for passes in (1, 10))
    shares = [pauses(each)[0] for each in (phrase, one, ten)]
    halves = [half_in(each) for each in (phrase, one, ten)]
    is_pause = _pausing(ten)
    own = Reference(phrase).nearest(ten[1:][is_pause]) if is_pause.any() else np.zeros(0)
    return {
        "pauses_recorded": shares[0],
        "pauses_1": shares[1],
        "pauses_10": shares[2],
        "more_pauses": shares[2] - max(shares[:2]),
        "half_in_recorded": halves[0],
        "half_in_10": halves[2],
        "sharper": _ratio(min(halves[:2]), halves[2]),
        "jumps": _ratio(_quick(ten), _quick(phrase)),
        "jump_ticks": pauses(ten)[1],
        "own_poses": float((own <= OWN_POSE).mean()) if len(own) else 0.0,
    }


def pauses(poses: Array) -> tuple[float, float]:
    """From poses (T, M, 4): share of ticks nearly still, and median length in ticks from one pause to the
    next.

    The length is not a number where there are no two pauses.
    """
    is_pause = _pausing(poses)
    edges = np.flatnonzero(np.diff(is_pause.astype(np.int8)))
    begins = edges[~is_pause[edges + 1]] + 1  # starts of jumps that follow a pause
    ends = edges[is_pause[edges + 1]] + 1
    lengths = [int(ends[ends > begin][0] - begin) for begin in begins if (ends > begin).any()]
    return float(is_pause.mean()), float(np.median(lengths)) if lengths else float("nan")


def half_in(poses: Array) -> float:
    """Share of ticks, the quickest of poses (T, M, 4), in which half of all motion happens.

    0.5 for even motion, whatever its speed, and a few hundredths where a body pauses and jumps.
    """
    speeds = np.sort(_speeds(poses))[::-1]
    sums = np.cumsum(speeds)
    if sums[-1] < STANDS_STILL:
        return float("nan")
    return float(np.interp(sums[-1] / 2, np.r_[0.0, sums], np.arange(len(sums) + 1))) / len(sums)


def holding(trial: Trial) -> dict[str, float]:
    """Degrees between the joint and a slowly turning hand."""
    found = {}
    for iterations in ((1, 1), (10, 5), (10, 10)):
        dance = trial.dance("turning", iterations, SLOW)
        assert dance.hand is not None, "a turning hand has orientations"
        apart = quaternion.angle_between(dance.poses[:, trial.place], dance.hand)
        found[f"{iterations[0]}/{iterations[1]}"] = float(np.degrees(apart).mean())
    return found


def influence(trial: Trial) -> dict[str, float]:
    """Degrees that a slowly turning hand moves the others by, and how that goes with the hand's distance."""
    moved = {}
    for iterations in ((1, 1), (10, 10)):
        dance = trial.dance("turning", iterations, SLOW)
        moved[iterations] = moved_by(trial, dance.poses, trial.looped.free(iterations[0]))
    assert dance.hand is not None, "a turning hand has orientations"
    distance = quaternion.angle_between(trial.looped.phrase[: len(dance.hand), trial.place], dance.hand)
    faint, full = (float(each.mean()) for each in moved.values())
    return {
        "1/1": faint,
        "10/10": full,
        "growth": full / max(faint, 0.1),
        "correlation": correlation(moved[10, 10], distance),
    }


def pace(trial: Trial) -> dict[str, float]:
    """Speed of the others, degrees a second, and how far they range, by the hand's pace at 10/10."""
    found = {"speed_free": _speed(trial, trial.looped.free(10))}
    for name in (SLOW, QUICK):
        poses = trial.dance("turning", (10, 10), name).poses
        found[f"speed_{name}"] = _speed(trial, poses)
        found[f"range_{name}"] = _range(without_heading(poses)[:, trial.others])
    return found | {
        "faster": _ratio(found[f"speed_{QUICK}"], found[f"speed_{SLOW}"]),
        "larger": _ratio(found[f"range_{SLOW}"], found[f"range_{QUICK}"]),
    }


def sensitivity(trials: Sequence[Trial]) -> dict[str, dict[str, float]]:
    """By excerpt: what a hand that is a little ahead changes, and what all excerpts together say of it.

    growth: the faster half of the excerpts by the slower half. chance: how often excerpts in random order
    agree as well with their speeds (permutation test on ranks, one-sided).
    """
    found = {}
    for trial in trials:
        usual = trial.dance("turning", (10, 10), QUICK).poses
        other = trial.nudged(TURNS_S[0], (10, 10))
        degrees = float(moved_by(trial, usual, other).mean()) / NUDGE_DEGREES
        speed = _speed(trial, trial.looped.phrase)
        found[trial.excerpt.name] = {"degrees_per_degree": degrees, "recorded_speed": speed}
    speeds = np.array([row["recorded_speed"] for row in found.values()])
    answers = np.array([row["degrees_per_degree"] for row in found.values()])
    together = {"growth": growth(speeds, answers), "chance": chance(speeds, answers)}
    return {name: row | together for name, row in found.items()}


def growth(speeds: Array, answers: Array) -> float:
    """Mean of answers (N,) in the faster half by speeds (N,), against the slower half; NaN of one."""
    order, half = np.argsort(speeds), len(speeds) // 2
    if not half:
        return float("nan")
    return float(answers[order[-half:]].mean() / max(answers[order[:half]].mean(), NO_ANSWER))


def chance(speeds: Array, answers: Array) -> float:
    """Share of all orders of answers (N,) whose ranks go with the speeds (N,) as well as these do.

    With few excerpts all orders are tried, else PERMUTATIONS random ones. 1 where all answers are equal, or
    where there is one excerpt.
    """
    first, second = (ranks - ranks.mean() for ranks in (_ranks(speeds), _ranks(answers)))
    if len(first) <= EXACT:
        orders = np.array(list(permutations(second)))
    else:
        random = np.random.default_rng(0)
        orders = random.permuted(np.tile(second, (PERMUTATIONS, 1)), axis=1)
        orders[0] = second
    return float((orders @ first >= first @ second - 1e-9).mean())


def moved_by(trial: Trial, poses: Poses, others: Poses) -> Array:
    """(T,) degrees between the joints that nobody holds in two dances."""
    count = min(len(poses), len(others))
    one, other = (without_heading(each[:count])[:, trial.others] for each in (poses, others))
    return motion.degrees_apart(one, other)


def correlation(a: Array, b: Array) -> float:
    """Pearson's of a (N,) and b (N,), the longer one cut; 0 where one of them is constant."""
    count = min(len(a), len(b))
    one, other = a[:count] - a[:count].mean(), b[:count] - b[:count].mean()
    size = float(np.sqrt((one**2).sum() * (other**2).sum()))
    return float((one * other).sum()) / size if size > 1e-9 else 0.0


def _apart(poses: Array, others: Array) -> float:
    return float(motion.degrees_apart(poses, others).mean())


def _speeds(poses: Array) -> Array:
    """(T - 1,): mean joint speed, degrees a tick."""
    return motion.degrees_apart(poses[1:], poses[:-1])


def _quick(poses: Array) -> float:
    """Degrees a tick while the quickest half of the motion happens; 0 for a body that stands still."""
    share = half_in(poses)
    total = float(_speeds(poses).mean())
    return total / 2 / share if share > 0 else 0.0


def _pausing(poses: Array) -> NDArray[np.bool_]:
    speeds = _speeds(poses)
    slow: NDArray[np.bool_] = speeds < PAUSE_SHARE * speeds.mean()
    return slow


def _speed(trial: Trial, poses: Poses) -> float:
    """Degrees a second, of the others."""
    return 50.0 * motion.energy(without_heading(poses)[:, trial.others])


def _range(poses: Array) -> float:
    """Degrees from their mean pose."""
    mean = quaternion.normalize(quaternion.aligned(poses, poses[0]).mean(axis=0))
    return float(np.degrees(quaternion.angle_between(poses, mean)).mean())


def _ranks(values: Array) -> Array:
    """(N,): 0 for the smallest; equal values share the mean of their ranks."""
    near = np.abs(values[:, None] - values[None]) < 1e-6
    below: Array = ((values[:, None] > values[None]) & ~near).sum(axis=1) + (near.sum(axis=1) - 1) / 2
    return below


def _ratio(value: float, own: float) -> float:
    """Not a number where there is nothing to compare with."""
    return value / own if own > 1e-9 and math.isfinite(value) else float("nan")
