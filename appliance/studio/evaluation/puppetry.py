"""Does the hand move the body? Figures of a coder that dances as in play with one joint held.

A phrase that nobody trained on, and as hand one joint's own orientation over time from another take: true
orientations of the same dancer, unrelated to the phrase. 'Others': the moving joints that are not held. All
angles are mean joint angles in degrees, heading removed. What the dancer ever did is the reference: the sound
poses of the training takes without their mirror images (with them every figure is the same to 0.4 degrees).
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from appliance.dancer.puppeteers import Puppeteer, TurningAxis
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import WINDOW
from appliance.studio.evaluation import motion_figures as motion
from appliance.studio.evaluation.coders import Coder
from appliance.studio.evaluation.in_play import FollowedOrientation, Rehearsal
from appliance.studio.evaluation.nearest import Floats, Reference, without_heading
from appliance.studio.evaluation.onset import onset_ticks

Iterations = tuple[int, int]  # coding, interaction

ITERATIONS: tuple[Iterations, ...] = ((1, 1), (2, 1), (10, 9), (10, 10), (30, 29))
IN_PLAY: Iterations = (10, 9)  # at which the onset and turning hands are measured
FREE = (1, 10, 30, 100)
TICKS = 1200
STEP = 5  # ticks from one search for the nearest pose to the next: the means stay the same to 0.1 degrees
TURNING_TICKS = 500  # two turns of the slow hand
TURNING = tuple((axis, seconds) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)) for seconds in (1.0, 5.0))


@dataclass(frozen=True)
class Pair:
    """A phrase and the recording of another take whose joints are its hands; names for people."""

    phrase: Recording
    hand: Recording
    phrase_name: str
    hand_name: str

    def orientations(self, joint: str, is_root: bool) -> Array:
        """(N, 4): the hand's orientations; a root's heading is the phrase's."""
        turns = self.hand.poses[:, self.hand.skeleton.index(joint)]
        if not is_root:
            return turns
        own = self.phrase.poses[: len(turns), self.phrase.skeleton.index(joint)]
        facing, away = quaternion.heading(own), quaternion.inverse(quaternion.heading(turns))
        return quaternion.multiply(facing, quaternion.multiply(away[: len(own)], turns[: len(own)]))


@dataclass(frozen=True)
class Figures:
    """Of one joint at one K/J. answer, fit*, held, *_degrees, largest_step in degrees, the others ratios to
    the phrase's own; found: share of ticks at which the dancer ever held the joint so (fit is of those)."""

    answer: float
    fit: float
    fit_own: float
    fit_bare: float
    plausibility: float
    energy: float
    roughness: float
    held: float
    plausibility_degrees: float
    largest_step: float
    found: float


class Measurement:
    """One pair: the phrase's own figures, reckoned once, and those of every dance on it."""

    def __init__(self, coder: Coder, pair: Pair, reference: Reference) -> None:
        ticks = min(len(pair.phrase), len(pair.hand), TICKS + WINDOW - 1)
        self.pair, self.reference, self.joints = pair, reference, coder.joints
        self.rehearsal = Rehearsal(coder, pair.phrase.excerpt(0, ticks / pair.phrase.fps))
        self.phrase = without_heading(self.rehearsal.phrase)
        self.phrase_far = reference.nearest(self.phrase[::STEP])
        self._own_fit: dict[str, Floats] = {}

    def hand(self, joint: str) -> Puppeteer:
        """The puppeteer that holds a joint as the other take did."""
        return FollowedOrientation(joint, self.pair.orientations(joint, self._is_root(joint)))

    def onset(self, joint: str, iterations: Iterations) -> float | None:
        """Ticks until half of the answer to a step of the hand is out."""
        turns = self.pair.orientations(joint, self._is_root(joint))
        return onset_ticks(self.rehearsal, joint, turns, iterations)

    def with_hand(self, joint: str, iterations: Iterations, hand: Puppeteer, ticks: int = TICKS) -> Figures:
        """The figures of the dance with a hand on a joint."""
        danced, hand_turns = self.rehearsal.held(*iterations, hand, slice(0, ticks))
        danced = without_heading(danced)
        free = without_heading(self.rehearsal.free(iterations[0]))[: len(danced)]
        phrase, rows = self.phrase[: len(danced)], slice(0, len(danced), STEP)
        held = self.joints.index(joint)
        others = [place for place in range(len(self.joints)) if place != held]
        if self._is_root(joint):
            hand_turns = without_heading(hand_turns[:, None])[:, 0]
        far = self.reference.nearest(danced[rows])
        own_far = self.phrase_far[: len(far)]
        fit = self.reference.nearest(danced[rows], others, held, hand_turns[rows])
        bare = self.reference.nearest(phrase[rows], others, held, hand_turns[rows])
        return Figures(
            answer=float(motion.degrees_apart(danced[:, others], free[:, others]).mean()),
            fit=_mean(fit),
            fit_own=_mean(self._fit_of_phrase(joint, others)[: len(far)]),
            fit_bare=_mean(bare),
            plausibility=float(far.mean() / own_far.mean()),
            energy=motion.energy(danced[:, others]) / motion.energy(phrase[:, others]),
            roughness=motion.roughness(danced[:, others]) / motion.roughness(phrase[:, others]),
            held=float(np.degrees(quaternion.angle_between(danced[:, held], hand_turns)).mean()),
            plausibility_degrees=float(far.mean()),
            largest_step=motion.largest_step(danced),
            found=float(np.isfinite(fit).mean()),
        )

    def free(self, coding_iterations: int) -> dict[str, float]:
        """The figures of the dance without a hand."""
        danced = without_heading(self.rehearsal.free(coding_iterations))
        far = self.reference.nearest(danced[::STEP])
        return {
            "plausibility": float(far.mean() / self.phrase_far.mean()),
            "energy": motion.energy(danced) / motion.energy(self.phrase),
            "roughness": motion.roughness(danced) / motion.roughness(self.phrase),
            "deviation": float(motion.degrees_apart(danced, self.phrase).mean()),
            "plausibility_degrees": float(far.mean()),
            "largest_step": motion.largest_step(danced),
        }

    def of_phrase(self) -> dict[str, float]:
        """The phrase's own figures, what the others are compared with."""
        return {
            "plausibility_degrees": float(self.phrase_far.mean()),
            "energy_degrees_a_tick": motion.energy(self.phrase),
            "roughness_degrees_a_tick2": motion.roughness(self.phrase),
            "largest_step": motion.largest_step(self.phrase),
        }

    def _fit_of_phrase(self, joint: str, others: list[int]) -> Floats:
        """The phrase's others against what the dancer did with that joint as the phrase has it."""
        if joint not in self._own_fit:
            held, phrase = self.joints.index(joint), self.phrase[::STEP]
            self._own_fit[joint] = self.reference.nearest(phrase, others, held, phrase[:, held])
        return self._own_fit[joint]

    def _is_root(self, joint: str) -> bool:
        return self.joints.index(joint) == 0


def measure(
    coder: Coder,
    pairs: Sequence[Pair],
    reference: Reference,
    joints: Sequence[str],
    iterations: Sequence[Iterations] = ITERATIONS,
    free: Sequence[int] = FREE,
    advance: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Keys JOINT.K_J.{answer,fit,...}, JOINT.onset_ticks, JOINT.turning.{...}, free.K.{...}, phrase.{...}.

    Means over the pairs; turning hands on the first one only. advance(words) is called before each dance, as
    often as `dances` says.
    """
    measurements = [Measurement(coder, pair, reference) for pair in pairs]
    in_play = IN_PLAY if IN_PLAY in iterations else max(iterations)
    found: dict[str, Any] = {}
    for joint in joints:
        figures: dict[str, Any] = {}
        for coding, interaction in iterations:
            rows = []
            for one in measurements:
                advance(f"hand on {joint}, {coding}/{interaction}")
                rows.append(asdict(one.with_hand(joint, (coding, interaction), one.hand(joint))))
            figures[f"{coding}_{interaction}"] = _means(rows)
        advance(f"steps of a hand on {joint}")
        onsets = [one.onset(joint, in_play) for one in measurements]
        known = [ticks for ticks in onsets if ticks is not None]
        figures["onset_ticks"] = float(np.median(known)) if known else None
        rows = []
        for axis, seconds in TURNING:
            advance(f"a hand that turns {joint}")
            hand = TurningAxis(joint, axis, seconds)
            rows.append(asdict(measurements[0].with_hand(joint, in_play, hand, TURNING_TICKS)))
        figures["turning"] = _means(rows)
        found[joint] = figures
    found["free"] = {}
    for coding in free:
        advance(f"without a hand, {coding}")
        found["free"][str(coding)] = _means([one.free(coding) for one in measurements])
    found["phrase"] = _means([one.of_phrase() for one in measurements])
    return found


def dances(
    pairs: int, joints: int, iterations: Sequence[Iterations] = ITERATIONS, free: Sequence[int] = FREE
) -> int:
    """How often measure advances."""
    return joints * (pairs * len(iterations) + 1 + len(TURNING)) + len(free)


def _mean(values: Floats) -> float:
    """Of the ticks that have a value."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _means(rows: Sequence[dict[str, float]]) -> dict[str, float | None]:
    """Of each figure over the rows; the largest of what is called so; None where no row has it."""
    merged: dict[str, float | None] = {}
    for name in rows[0]:
        values = [row[name] for row in rows if math.isfinite(row[name])]
        whole = max if name == "largest_step" else statistics.fmean
        merged[name] = round(whole(values), 3) if values else None
    return merged
