"""The families of experiments: only coding iterations, a joint kept, turned, led by a sensor, held still."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from appliance.dancer.motion_source import Playback
from appliance.dancer.puppeteers import FixedOrientation, Kept, Puppeteer, TurningAxis
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.coders import Coder, Poses
from appliance.studio.evaluation.dance_figures import BodyFigures
from appliance.studio.evaluation.in_play import FollowedOrientation, Rehearsal
from appliance.studio.evaluation.measurement import Iterations
from appliance.studio.experiments.excerpts import LEAD, Excerpt

CODING = tuple(range(1, 11))
AS_IN_THE_PAPER: tuple[Iterations, ...] = ((1, 1), (10, 5), (10, 10))
WITH_SENSOR: tuple[Iterations, ...] = ((2, 1), (10, 9))
TURNS_S = (1.0, 5.0)
AXIS = (0.0, 0.0, 1.0)
TURNING_TICKS = 750  # three turns of the slow hand
FIXED_DEGREES = (
    45,
    135,
)  # from the excerpt's mean orientation: one that dancers take, and one that none does
NUDGE_DEGREES = 5.0


@dataclass(frozen=True)
class Condition:
    """family: coding, kept, turning, sensor, fixed; variant: which hand of it, '' where there is only one."""

    family: str
    iterations: Iterations
    variant: str = ""

    @property
    def name(self) -> str:
        """For files: turning_1s_10_5."""
        return "_".join(part for part in (self.family, self.variant, *map(str, self.iterations)) if part)

    @property
    def label(self) -> str:
        """For people: 'turning, 1 s: 10/5'."""
        coding, interaction = self.iterations
        if self.family == "coding":
            return f"{coding} coding iteration{'s' if coding > 1 else ''}"
        return f"{self.family}{', ' if self.variant else ''}{self.variant}: {coding}/{interaction}"


@dataclass(frozen=True)
class Dance:
    """The dance, (T, M, 4) of the moving joints, next to the excerpt; the hand's orientations (T, 4)."""

    condition: Condition
    poses: Poses
    hand: Array | None = None


CONDITIONS = (
    *(Condition("coding", (count, 0)) for count in CODING),
    *(Condition("kept", iterations) for iterations in AS_IN_THE_PAPER),
    *(Condition("turning", each, f"{seconds:g}s") for seconds in TURNS_S for each in AS_IN_THE_PAPER),
    *(Condition("sensor", iterations) for iterations in WITH_SENSOR),
    *(Condition("fixed", (10, 9), f"{degrees}deg") for degrees in FIXED_DEGREES),
)


class Trial:
    """One excerpt danced under every condition, with one joint in the hand; several may be kept.

    once: the excerpt's frames as recorded; looped: the same over and over, as the box plays an excerpt, for
    the families whose hand takes longer than the excerpt.
    """

    def __init__(self, coder: Coder, excerpt: Excerpt, joints: Sequence[str], trace: Array) -> None:
        """joints: the first is in the hand, all of them are kept; trace: (N, 4) orientations of the first at
        50 Hz, local to its parent, as a sensor gives them.
        """
        self.excerpt, self.joints, self.joint, self._trace = excerpt, tuple(joints), joints[0], trace
        self.once = Rehearsal(coder, excerpt.recording, "hann")
        self.looped = Rehearsal(coder, _looped(excerpt.recording, TURNING_TICKS + 2 * LEAD), "hann")
        self.place = coder.joints.index(self.joint)
        self.others = [place for place in range(len(coder.joints)) if place != self.place]
        self.dances: dict[Condition, Dance] = {}

    def run(self, advance: Callable[[str], None] = lambda _: None) -> None:
        """Dance all conditions; advance(description) before each."""
        for condition in CONDITIONS:
            advance(f"{self.excerpt.name}: {condition.label}")
            self.dances[condition] = self._dance(condition)

    def dance(self, family: str, iterations: Iterations, variant: str = "") -> Dance:
        """One of the conditions, danced now if it was not yet."""
        condition = Condition(family, iterations, variant)
        if condition not in self.dances:
            self.dances[condition] = self._dance(condition)
        return self.dances[condition]

    def held_joints(self, condition: Condition) -> tuple[str, ...]:
        """By name, the one in the hand first."""
        return {"coding": (), "kept": self.joints}.get(condition.family, (self.joint,))

    def rehearsal(self, condition: Condition) -> Rehearsal:
        """The source that a condition was danced on."""
        return self.once if condition.family in ("coding", "kept") else self.looped

    def whole(self, dance: Dance) -> Recording:
        """A dance with all joints, standing on the floor as on the box."""
        rehearsal = self.rehearsal(dance.condition)
        return as_recording(rehearsal, dance.poses)

    def nudged(self, seconds: float, iterations: Iterations) -> Poses:
        """The dance with a turning hand that is NUDGE_DEGREES ahead of the usual one all the time."""
        ahead = TurningAxis(self.joint, AXIS, seconds, turned=np.radians(NUDGE_DEGREES))
        return self.looped.held(*iterations, ahead)[0]

    def _dance(self, condition: Condition) -> Dance:
        coding, interaction = condition.iterations
        if condition.family == "coding":
            return Dance(condition, self.once.free(coding))
        rehearsal = self.rehearsal(condition)
        others = [Kept(joint) for joint in self.held_joints(condition)[1:]]
        poses, hand = rehearsal.held(coding, interaction, self._hand(condition), others=others)
        return Dance(condition, poses, hand)

    def _hand(self, condition: Condition) -> Puppeteer:
        if condition.family == "kept":
            return Kept(self.joint)
        if condition.family == "turning":
            return TurningAxis(self.joint, AXIS, float(condition.variant.removesuffix("s")))
        if condition.family == "sensor":
            return FollowedOrientation(self.joint, self._trace)
        usual = quaternion.normalize(
            quaternion.aligned(self.once.phrase[:, self.place], self.once.phrase[0, self.place]).mean(axis=0)
        )
        turn = quaternion.from_axis_angle(AXIS, np.radians(float(condition.variant.removesuffix("deg"))))
        return FixedOrientation(self.joint, quaternion.multiply(turn, usual).tolist())


def as_recording(rehearsal: Rehearsal, poses: Poses) -> Recording:
    """Poses (T, M, 4) of the moving joints as a whole body on the excerpt's path, feet on the floor."""
    whole, roots = _body_figures(rehearsal).grounded(rehearsal.whole(poses))
    return Recording(rehearsal.recording.skeleton, quaternion.continuous(whole), roots, FPS)


@cache
def _body_figures(rehearsal: Rehearsal) -> BodyFigures:
    return BodyFigures(rehearsal.recording)


def usual_trace(excerpts: Sequence[Excerpt], place: int) -> Array:
    """Where no sensor was recorded: how the liveliest excerpt carries the joint, (N, 4)."""
    liveliest = max(excerpts, key=lambda one: one.measures.whole).recording
    once: Array = liveliest.poses[:, place]
    there_and_back = np.concatenate([once, once[::-1]])
    return np.tile(there_and_back, (1 + TURNING_TICKS // len(there_and_back), 1))


def _looped(recording: Recording, ticks: int) -> Recording:
    """The recording over and over, crossfaded as on the box."""
    motion = Playback(recording)
    poses, roots = [], []
    for _ in range(ticks):
        poses.append(motion.window()[0].copy())
        roots.append(motion.roots()[0].copy())
        motion.advance()
    return Recording(recording.skeleton, quaternion.continuous(np.array(poses)), np.array(roots), FPS)
