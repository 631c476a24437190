"""The figures of dances on one phrase with hands from one other take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from appliance.dancer.puppeteers import Puppeteer
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import WINDOW
from appliance.studio.evaluation import dance_figures as figures
from appliance.studio.evaluation.coders import Coder, Poses
from appliance.studio.evaluation.in_play import FollowedOrientation, Rehearsal
from appliance.studio.evaluation.nearest import Floats, Reference, without_heading
from appliance.studio.evaluation.onset import StepAnswer, answer_to_steps

TICKS = 1200
STEP = 5  # ticks between searches for the nearest pose: changes the means by less than 0.1 degrees
Iterations = tuple[int, int]  # coding, interaction


@dataclass(frozen=True)
class Pair:
    """A phrase, the recording of another take whose joints are the hands, and their names."""

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
    """Figures of one joint at one K/J.

    answer, fit, fit_own, fit_bare, held, plausibility_degrees, largest_step: degrees. plausibility, energy,
    roughness: ratios to the phrase's own. snap: the largest step against the largest one of the recordings.
    found: share of ticks whose hand orientation occurs in the recordings; fit is over those. arm_in_trunk:
    share of ticks. arm_depth_cm: 99th percentile. arms_touch, strained (of the others): share of ticks.
    foot_skate: metres a second.
    """

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
    snap: float
    found: float
    arm_in_trunk: float
    arm_depth_cm: float
    arms_touch: float
    strained: float
    foot_skate: float


@dataclass(frozen=True)
class Danced:
    """A dance (T, M, 4), the hand (T, 4) on a joint; as they leave the box: poses (T, J, 4), roots (T, 3)."""

    joint: str
    shown: Poses
    hand: Array
    standing: Array
    roots: Array


class Measurement:
    """One pair: the phrase's own figures, computed once, and those of every dance on it."""

    def __init__(self, coder: Coder, pair: Pair, reference: Reference) -> None:
        ticks = min(len(pair.phrase), len(pair.hand), TICKS + WINDOW - 1)
        self.pair, self.reference, self.joints = pair, reference, coder.joints
        self.rehearsal = Rehearsal(coder, pair.phrase.excerpt(0, ticks / pair.phrase.fps))
        self.body = figures.BodyFigures(self.rehearsal.recording)
        self.phrase = without_heading(self.rehearsal.phrase)
        self.phrase_far = reference.nearest(self.phrase[::STEP])
        self._own_fit: dict[str, Floats] = {}
        self._bare_fit: dict[tuple[str, bytes], float] = {}

    def hand(self, joint: str) -> Puppeteer:
        """The puppeteer that holds a joint as the other take does."""
        return FollowedOrientation(joint, self.pair.orientations(joint, self._is_root(joint)))

    def steps(self, joint: str, iterations: Iterations) -> StepAnswer:
        """The answer to steps of the hand from one of its orientations to another."""
        turns = self.pair.orientations(joint, self._is_root(joint))
        return answer_to_steps(self.rehearsal, joint, turns, iterations)

    def with_hand(self, joint: str, iterations: Iterations, hand: Puppeteer, ticks: int = TICKS) -> Figures:
        """The figures of the dance with a hand on a joint."""
        return self.figures(self.danced(joint, iterations, hand, ticks), iterations[0])

    def danced(self, joint: str, iterations: Iterations, hand: Puppeteer, ticks: int = TICKS) -> Danced:
        """The dance with a hand on a joint."""
        shown, hand_turns = self.rehearsal.held(*iterations, hand, slice(0, ticks))
        return self.stood(joint, shown, hand_turns)

    def stood(self, joint: str, shown: Poses, hand: Array) -> Danced:
        """A dance (T, M, 4) with a hand (T, 4) on a joint, as it leaves the box."""
        return Danced(joint, shown, hand, *self.body.grounded(self.rehearsal.whole(shown), joint))

    def as_recorded(self, joint: str, ticks: int) -> Danced:
        """The phrase itself, with its own joint as the hand; its legs are left as they are."""
        shown = self.rehearsal.phrase[:ticks]
        standing, roots = self.body.grounded(self.rehearsal.whole(shown), locked=False)
        return Danced(joint, shown, shown[:, self.joints.index(joint)], standing, roots)

    def hand_take(self, ticks: int) -> Array:
        """(T, M, 4): what the hand's take really did at the ticks of the dance, headings removed."""
        places = [self.pair.hand.skeleton.index(name) for name in self.joints]
        return without_heading(self.pair.hand.poses[WINDOW - 1 :, places][:ticks])

    def level(self, dance: Danced) -> tuple[Array, Array]:
        """A dance (T, M, 4) and its hand (T, 4), headings removed."""
        hand = dance.hand
        if self._is_root(dance.joint):
            hand = without_heading(hand[:, None])[:, 0]
        return without_heading(dance.shown), hand

    def figures(self, dance: Danced, coding_iterations: int) -> Figures:
        """The figures of a dance, against the same coding iterations without a hand."""
        joint = dance.joint
        danced, hand_turns = self.level(dance)
        free = self.rehearsal.free(coding_iterations)[: len(danced)]
        phrase, rows = self.phrase[: len(danced)], slice(0, len(danced), STEP)
        held, others = self.joints.index(joint), self._others(joint)
        far = self.reference.nearest(danced[rows])
        own_far = self.phrase_far[: len(far)]
        fit = self.reference.nearest(danced[rows], others, held, hand_turns[rows])
        return Figures(
            answer=self.answer(joint, dance.shown, free),
            fit=_mean(fit),
            fit_own=_mean(self._fit_of_phrase(joint, others)[: len(far)]),
            fit_bare=self._fit_of_pasted(joint, others, hand_turns[rows]),
            plausibility=_ratio(far.mean(), own_far.mean()),
            energy=_ratio(figures.energy(danced[:, others]), figures.energy(phrase[:, others])),
            roughness=_ratio(figures.roughness(danced[:, others]), figures.roughness(phrase[:, others])),
            held=float(np.degrees(quaternion.angle_between(danced[:, held], hand_turns)).mean()),
            plausibility_degrees=float(far.mean()),
            found=float(np.isfinite(fit).mean()),
            strained=self.reference.strained(danced[rows], others),
            **self._figures_of_body(dance.shown, dance.standing, dance.roots),
        )

    def answer(self, joint: str, danced: Poses, free: Poses) -> float:
        """How far a hand moves the others, degrees: a dance (T, M, 4) with it against one without."""
        others = self._others(joint)
        apart = figures.degrees_apart(without_heading(danced)[:, others], without_heading(free)[:, others])
        return float(apart.mean())

    def free(self, coding_iterations: int) -> dict[str, float]:
        """The figures of the dance without a hand."""
        shown = self.rehearsal.free(coding_iterations)
        danced = without_heading(shown)
        far = self.reference.nearest(danced[::STEP])
        return {
            "plausibility": _ratio(far.mean(), self.phrase_far.mean()),
            "energy": _ratio(figures.energy(danced), figures.energy(self.phrase)),
            "roughness": _ratio(figures.roughness(danced), figures.roughness(self.phrase)),
            "deviation": float(figures.degrees_apart(danced, self.phrase).mean()),
            "plausibility_degrees": float(far.mean()),
            "strained": self.reference.strained(danced[::STEP]),
            **self._of_body(shown),
        }

    def of_phrase(self) -> dict[str, float]:
        """The phrase's own figures, with which the others are compared."""
        whole = self.rehearsal.whole(self.rehearsal.phrase)
        _, roots = self.body.grounded(whole, locked=False)
        return {
            "plausibility_degrees": float(self.phrase_far.mean()),
            "strained": self.reference.strained(self.phrase[::STEP]),
            "energy_degrees_a_tick": figures.energy(self.phrase),
            "roughness_degrees_a_tick2": figures.roughness(self.phrase),
            **self._figures_of_body(self.rehearsal.phrase, whole, roots),
        }

    def _of_body(self, danced: Poses) -> dict[str, float]:
        """The largest step, arms in the trunk and feet that slide, as they leave the box."""
        poses, roots = self.body.grounded(self.rehearsal.whole(danced))
        return self._figures_of_body(danced, poses, roots)

    def _figures_of_body(self, danced: Poses, poses: Array, roots: Array) -> dict[str, float]:
        step = figures.largest_step(without_heading(danced))
        return {
            "largest_step": step,
            "snap": _ratio(step, self.reference.largest_step),
            **self.body.arms(poses)._asdict(),
            "foot_skate": self.body.foot_skate(poses, roots),
        }

    def _fit_of_phrase(self, joint: str, others: list[int]) -> Floats:
        """The phrase's others against recorded poses that hold the joint as the phrase does."""
        if joint not in self._own_fit:
            held, phrase = self.joints.index(joint), self.phrase[::STEP]
            self._own_fit[joint] = self.reference.nearest(phrase, others, held, phrase[:, held])
        return self._own_fit[joint]

    def _fit_of_pasted(self, joint: str, others: list[int], hand_turns: Floats) -> float:
        """The phrase's others against recorded poses that hold the joint as the hand does."""
        key = joint, hand_turns.tobytes()  # the same hand comes at several iterations
        if key not in self._bare_fit:
            held, phrase = self.joints.index(joint), self.phrase[::STEP][: len(hand_turns)]
            self._bare_fit[key] = _mean(self.reference.nearest(phrase, others, held, hand_turns))
        return self._bare_fit[key]

    def _others(self, joint: str) -> list[int]:
        """Places of the joints that the hand does not hold."""
        return [place for place, name in enumerate(self.joints) if name != joint]

    def _is_root(self, joint: str) -> bool:
        return self.joints.index(joint) == 0


def _mean(values: Floats) -> float:
    """Mean of the finite values."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _ratio(value: float | np.floating[Any], own: float | np.floating[Any]) -> float:
    """Ratio to the phrase's own; NaN if the phrase stands still."""
    return float(value) / float(own) if own > 0 else float("nan")
