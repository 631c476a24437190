"""What the paper found, (a) to (g), each with a measure, its figure for every excerpt and whether it holds.

Degrees are mean joint angles, heading removed. 'Others': the joints that the hand does not hold. The bounds
say when a figure is taken to agree with the paper's words, which give no numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.evaluation import dance_figures as motion
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.nearest import Reference, without_heading
from appliance.studio.experiments.families import NUDGE_DEGREES, TURNS_S, Trial

FAITHFUL = 3.0  # degrees after one pass
STAYS = 5.0  # degrees after ten
PAUSE_SHARE = 0.3  # of the excerpt's mean speed: below it a body nearly stands still
MORE_PAUSES = 0.1  # of the time
OWN_POSE = 8.0  # degrees from a pose of the excerpt: nearly that pose
SHOWS, HIDDEN = 3.0, 6.0  # degrees between the joint and the hand
FAINT = 2.0  # degrees that the others are moved by at 1/1
STILL = "still"


@dataclass(frozen=True)
class Claim:
    """letter and words of the paper; measure: what the figures are; figures: by excerpt and name.

    holds: by excerpt, and `holds_on_the_whole`.
    """

    letter: str
    words: str
    measure: str
    figures: Mapping[str, Mapping[str, float]]
    holds: Mapping[str, bool]
    most: float = 0.5

    @property
    def holds_on_the_whole(self) -> bool:
        """In more than `most` of the excerpts that it is about."""
        return sum(self.holds.values()) > self.most * len(self.holds)

    def as_json(self) -> dict[str, object]:
        """For the report."""
        figures = {
            name: {key: round(value, 3) if math.isfinite(value) else None for key, value in row.items()}
            for name, row in self.figures.items()
        }
        return {
            "claim": self.words,
            "measure": self.measure,
            "figures": figures,
            "holds": dict(self.holds),
            "holds_on_the_whole": self.holds_on_the_whole,
        }


def claims(trials: Sequence[Trial]) -> list[Claim]:
    """All seven, from trials that were run; (b) is about the excerpt that is named `still`."""
    still = [one for one in trials if one.excerpt.name == STILL]
    moving = [one for one in trials if one.excerpt.name != STILL] or list(trials)
    return [
        _claim(
            "a",
            "One pass reproduces the recording faithfully.",
            "degrees from the excerpt after one pass",
            trials,
            lambda one: {"degrees": _apart(one, 1)},
            lambda row: row["degrees"] <= FAITHFUL,
        ),
        _claim(
            "b",
            "A static excerpt stays as it is, at ten passes as well.",
            "degrees from the excerpt after ten passes; the other excerpts for comparison",
            trials,
            lambda one: {"degrees": _apart(one, 10)},
            lambda row: row["degrees"] <= STAYS,
            about=still,
        ),
        _claim(
            "c",
            "Above one pass smooth motion becomes intermittent: it pauses on poses, mostly of the excerpt, "
            "and jumps.",
            f"share of the time below {PAUSE_SHARE:.0%} of the excerpt's mean speed, in the recording, after "
            "one and after ten passes; median length of the jumps between two pauses after ten, in ticks; "
            f"share of poses within {OWN_POSE:g} degrees of one of the excerpt",
            moving,
            _intermittency,
            lambda row: row["pauses_10"] - row["pauses_1"] >= MORE_PAUSES,
        ),
        _claim(
            "d",
            "The held orientation shows only when all passes are interaction iterations.",
            "degrees between the joint and a hand at five seconds a turn, at 1/1, 10/5 and 10/10 (blending "
            "follows such a hand by 2 degrees)",
            trials,
            _held,
            lambda row: max(row["1/1"], row["10/10"]) <= SHOWS and row["10/5"] >= HIDDEN,
        ),
        _claim(
            "e",
            "The influence on the other joints is very small at 1/1 and grows with the passes and with the "
            "distance of the hand from the recording.",
            "degrees that the others are moved by a hand at five seconds a turn, at 1/1 and 10/10; "
            "correlation of that with the hand's distance from the recorded orientation over the ticks at "
            "10/10",
            trials,
            _influence,
            lambda row: row["1/1"] <= FAINT and row["10/10"] > 2 * row["1/1"] and row["correlation"] > 0.0,
        ),
        _claim(
            "f",
            "The speed of the turning joint sets the pace of the whole skeleton, also of a static excerpt; "
            "slow turns make larger motion.",
            "speed of the others at 10/10 in degrees a second without a hand, at five seconds and at one "
            "second a turn; how far they range at both (degrees from their mean pose)",
            trials,
            _pace,
            lambda row: row["speed_1s"] > row["speed_5s"] and row["range_5s"] > row["range_1s"],
        ),
        _sensitivity(trials),
    ]


def pauses(poses: Array, mean_speed: float) -> tuple[float, float]:
    """Of poses (T, M, 4): share of ticks nearly still, and median length in ticks from one pause to the next.

    The length is not a number where there are no two pauses.
    """
    speeds = np.degrees(quaternion.angle_between(poses[1:], poses[:-1])).mean(axis=1)
    is_pause: NDArray[np.bool_] = speeds < PAUSE_SHARE * mean_speed
    edges = np.flatnonzero(np.diff(is_pause.astype(np.int8)))
    begins = edges[~is_pause[edges + 1]] + 1  # of jumps that follow a pause
    ends = edges[is_pause[edges + 1]] + 1
    lengths = [int(ends[ends > begin][0] - begin) for begin in begins if (ends > begin).any()]
    return float(is_pause.mean()), float(np.median(lengths)) if lengths else float("nan")


def _claim(
    letter: str,
    words: str,
    measure: str,
    trials: Sequence[Trial],
    figures: Callable[[Trial], Mapping[str, float]],
    holds: Callable[[Mapping[str, float]], bool],
    about: Sequence[Trial] | None = None,
) -> Claim:
    """about: the excerpts that the claim speaks of, where it is not about all that are measured."""
    found = {one.excerpt.name: figures(one) for one in trials}
    spoken_of = trials if about is None else about
    held = {one.excerpt.name: bool(holds(found[one.excerpt.name])) for one in spoken_of}
    return Claim(letter, words, measure, found, held)


def _apart(trial: Trial, passes: int) -> float:
    danced = trial.dance("coding", (passes, 0)).poses
    return float(motion.degrees_apart(without_heading(danced), without_heading(trial.once.phrase)).mean())


def _intermittency(trial: Trial) -> Mapping[str, float]:
    phrase = without_heading(trial.once.phrase)
    speed = motion.energy(phrase)
    excerpt = Reference(phrase)
    found = {"pauses_recorded": pauses(phrase, speed)[0]}
    for passes in (1, 10):
        danced = without_heading(trial.dance("coding", (passes, 0)).poses)
        found[f"pauses_{passes}"], jumps = pauses(danced, speed)
        if passes > 1:
            found["jump_ticks"] = jumps
            found["own_poses"] = float((excerpt.nearest(danced) <= OWN_POSE).mean())
    return found


def _held(trial: Trial) -> Mapping[str, float]:
    found = {}
    for iterations in ((1, 1), (10, 5), (10, 10)):
        dance = trial.dance("turning", iterations, f"{TURNS_S[1]:g}s")
        assert dance.hand is not None, "a turning hand has orientations"
        apart = quaternion.angle_between(dance.poses[:, trial.place], dance.hand)
        found[_words(iterations)] = float(np.degrees(apart).mean())
    return found


def _influence(trial: Trial) -> Mapping[str, float]:
    found = {}
    for iterations in ((1, 1), (10, 10)):
        dance = trial.dance("turning", iterations, f"{TURNS_S[1]:g}s")
        moved = _moved(trial, dance.poses, trial.looped.free(iterations[0]))
        found[_words(iterations)] = float(moved.mean())
    assert dance.hand is not None, "a turning hand has orientations"
    distance = quaternion.angle_between(trial.looped.phrase[: len(dance.hand), trial.place], dance.hand)
    return found | {"correlation": _correlation(moved, distance)}


def _pace(trial: Trial) -> Mapping[str, float]:
    found = {"speed_free": _speed(trial, trial.looped.free(10))}
    for seconds in TURNS_S:
        poses = trial.dance("turning", (10, 10), f"{seconds:g}s").poses
        found[f"speed_{seconds:g}s"] = _speed(trial, poses)
        found[f"range_{seconds:g}s"] = _range(without_heading(poses)[:, trial.others])
    return found


def _sensitivity(trials: Sequence[Trial]) -> Claim:
    """(g), of which all excerpts together are the measure: more of it where the recording is faster."""
    found, by_speed = {}, []
    for trial in trials:
        usual = trial.dance("turning", (10, 10), f"{TURNS_S[0]:g}s").poses
        other = trial.nudged(TURNS_S[0], (10, 10))
        degrees = float(_moved(trial, usual, other).mean()) / NUDGE_DEGREES
        speed = _speed(trial, trial.looped.phrase)
        found[trial.excerpt.name] = {"degrees_per_degree": degrees, "recorded_speed": speed}
        by_speed.append((speed, degrees))
    speeds, answers = (np.array(column) for column in zip(*by_speed, strict=True))
    rank = 0.0 if np.ptp(answers) < 1e-6 else _correlation(*(_ranks(each) for each in (speeds, answers)))
    found = {name: row | {"rank_correlation": rank} for name, row in found.items()}
    return Claim(
        "g",
        "Fast recordings make the answer unpredictable.",
        f"degrees that the others differ by for each degree that the hand is ahead (by {NUDGE_DEGREES:g}), "
        "at one second a turn and 10/10; holds where it grows with the excerpt's speed, by rank, over all "
        "excerpts",
        found,
        dict.fromkeys(found, rank > 0.5),
    )


def _moved(trial: Trial, poses: Poses, others: Poses) -> Array:
    """(T,) degrees between the joints that nobody holds in two dances."""
    count = min(len(poses), len(others))
    one, other = (without_heading(each[:count])[:, trial.others] for each in (poses, others))
    return motion.degrees_apart(one, other)


def _speed(trial: Trial, poses: Poses) -> float:
    """Degrees a second, of the others."""
    return 50.0 * motion.energy(without_heading(poses)[:, trial.others])


def _range(poses: Array) -> float:
    mean = quaternion.normalize(quaternion.aligned(poses, poses[0]).mean(axis=0))
    return float(np.degrees(quaternion.angle_between(poses, mean)).mean())


def _correlation(a: Array, b: Array) -> float:
    count = min(len(a), len(b))
    one, other = a[:count] - a[:count].mean(), b[:count] - b[:count].mean()
    size = float(np.sqrt((one**2).sum() * (other**2).sum()))
    return float((one * other).sum()) / size if size > 1e-9 else 0.0


def _ranks(values: Array) -> Array:
    return np.argsort(np.argsort(values)).astype(float)


def _words(iterations: tuple[int, int]) -> str:
    return f"{iterations[0]}/{iterations[1]}"
