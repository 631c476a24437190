"""Values that the lights read from the dance: positions, speeds and orientations of joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.motion_features import Floats, MotionFeatures, TurnFeatures
from appliance.pose import quaternion
from appliance.pose.roles import roles_of
from appliance.pose.skeleton import Skeleton
from appliance.show.light_rules import FEATURES, RuleConfig

SMOOTHING_S = 0.06  # window of speeds: three ticks, so that one late frame is no step
PAUSE_S = 0.2  # without a new frame for this long, nothing moves
# Passes are at 40 Hz, frames at 50: every fourth frame is skipped. Places move on with their velocities until
# the next frame, at most this long; else heads tremble at 10 Hz and its harmonics.
MOST_ON_S = 0.03
FASTEST_M_S = 15.0  # no joint of a dancer is faster; a phrase that jumps is
EYES_M = 0.08  # above the head's joint
_FRONT, _ABOVE = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
HELD = 0.1  # a joint that is held less firmly answers
ROOT = 0
_COORDINATE = {"across": 0, "height": 1, "depth": 2}


class Dances:
    """The dance of each puppet, by name; of each hand and of a live dancer."""

    def __init__(
        self, skeleton: Skeleton, puppets: Sequence[str], led: str, hands: Sequence[tuple[str, str]] = ()
    ) -> None:
        """led: the name of the one that cues lead. hands: puppet and joint of each, by rows of the frame."""
        self._by_name, self._led = {name: Dance(skeleton) for name in puppets}, led
        self._hands = [(hand, Felt(TurnFeatures)) for hand in hands]
        self._live, self._seen = Dance(skeleton), PuppetFrame.of(len(skeleton))
        self._time, self._generation = -math.inf, -1

    def take_frame(self, frame: JointFrame, generation: int, now: float) -> None:
        """Take the newest frame, which may be the same again; `generation`: the stage's."""
        for dance, puppet in zip(self._by_name.values(), frame.puppets, strict=False):
            dance.take_frame(frame, puppet, generation, now)
        if frame.live.any():
            self._seen.positions[:] = frame.live
            self._live.take_frame(frame, self._seen, generation, now)
        else:
            self._live.rest(now)
        elapsed_s = frame.frame_time - self._time
        for (_, felt), orientation in zip(self._hands, frame.hands, strict=False):
            if generation != self._generation:
                felt.begin_anew()
            if elapsed_s > 0.0 and not frame.late:
                felt.take(orientation, frame.frame_time, min(elapsed_s, PAUSE_S))
            elif now - self._time > PAUSE_S:
                felt.rest()
        self._generation = generation
        if not frame.late:
            self._time = frame.frame_time

    def read(self, rule: RuleConfig) -> float:
        """A rule's present input: metres, metres a second or degrees; of a hand radians."""
        if rule.of == "live":
            return self._live.read(rule)
        if rule.of is None:
            return self.of(rule.puppet).read(rule)
        puppet = self._led if rule.puppet is None else rule.puppet
        for (name, joint), felt in self._hands:
            if name == puppet and rule.joint in (None, joint):
                return felt.read(rule.reads)
        return 0.0

    def of(self, puppet: str | None) -> Dance:
        """The dance of a puppet; None: of the one that cues lead."""
        return self._by_name[self._led if puppet is None else puppet]


class Dance:
    """A puppet's newest frame and how fast its joints move. Arrays are (J, ...) in the skeleton's order."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        joints = len(skeleton)
        self.positions: NDArray[np.float64] = np.zeros((joints, 3))  # world, metres
        self.pose: NDArray[np.float64] = np.tile(quaternion.IDENTITY.astype(float), (joints, 1))
        self.world = self.pose.copy()
        self.speeds: NDArray[np.float64] = np.zeros(joints)  # metres a second
        self.body_speed = 0.0
        self.answer = 0.0  # mean degrees from the phrase, smoothed
        self._velocities = np.zeros((joints, 3))
        self._head = roles_of(skeleton.names).get("head")
        if self._head is not None:  # its own axes of where it looks and of what is up, while the body stands
            _, standing = skeleton.forward_kinematics(skeleton.standing, np.zeros(3))
            inverse = quaternion.inverse(standing[self._head])
            self._forward, self._up = (quaternion.rotate(inverse, np.array(way)) for way in (_FRONT, _ABOVE))
        self._age_s = 0.0  # age of the newest frame since it left the stage
        self._felt = Felt(lambda: MotionFeatures(joints))
        self._time = -math.inf
        self._tick: tuple[int, int] | None = None

    def take_frame(self, frame: JointFrame, puppet: PuppetFrame, generation: int, now: float) -> None:
        """Take the puppet's newest frame, which may be the same again; `generation`: the stage's."""
        tick = (generation, frame.tick)
        self._age_s = min(max(now - max(frame.left, frame.frame_time), 0.0), MOST_ON_S)
        self.__dict__.pop("eyes", None)
        if tick == self._tick:
            self.rest(now)
            return
        if (not frame.late or self._tick is None) and np.isfinite(puppet.positions).all():
            self._measure(frame, puppet, generation)
        self._tick = tick

    def rest(self, now: float) -> None:
        """No new frame shows it: after a pause it stands still."""
        if now - self._time > PAUSE_S:
            self._settle(np.zeros_like(self.speeds), PAUSE_S)
            self._felt.rest()
            self._velocities[:] = 0.0

    def read(self, rule: RuleConfig) -> float:
        """A rule's present input: metres, metres a second or degrees."""
        joint = ROOT if rule.joint is None else self.skeleton.index(rule.joint)
        if rule.reads in _COORDINATE:
            return float(self._now(joint)[_COORDINATE[rule.reads]])
        if rule.reads == "speed":
            return self.body_speed if rule.joint is None else float(self.speeds[joint])
        if rule.reads == "answer":
            return self.answer
        if rule.reads in FEATURES:
            return self._felt.read(rule.reads)
        turned = self.pose[joint] if rule.relative else self.world[joint]
        return turn(turned, rule.axis) if rule.reads == "turn" else lean(turned, rule.axis)

    def place(self, joint: str | None) -> NDArray[np.float64]:
        """Position of a joint (None: the root), (3,) metres."""
        return self._now(ROOT if joint is None else self.skeleton.index(joint))

    @cached_property
    def eyes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """The dancer's eyes, (3,) metres, and where they look, a unit vector; None: there is no head.

        Computed once a pass: `take_frame` begins one.
        """
        if self._head is None:
            return None
        turned = self.world[self._head]
        gaze, up = (np.asarray(quaternion.rotate(turned, way), float) for way in (self._forward, self._up))
        return self._now(self._head) + EYES_M * up, gaze

    def _now(self, joint: int) -> NDArray[np.float64]:
        """The joint's position moved on to this pass, (3,) metres."""
        where: NDArray[np.float64] = self.positions[joint] + self._age_s * self._velocities[joint]
        return where

    def _measure(self, frame: JointFrame, puppet: PuppetFrame, generation: int) -> None:
        elapsed_s = frame.frame_time - self._time
        continues = self._tick is not None and self._tick[0] == generation
        if continues and 0.0 < elapsed_s < PAUSE_S:
            self._velocities[:] = (puppet.positions - self.positions) / elapsed_s
            speeds = np.linalg.norm(self._velocities, axis=-1)
            if speeds.max() > FASTEST_M_S:  # a jump: motion begins anew
                self._velocities[:] = 0.0
                self._felt.begin_anew()
            self._settle(np.minimum(speeds, FASTEST_M_S), elapsed_s)
        else:
            self._velocities[:] = 0.0
            self._settle(np.zeros_like(self.speeds), PAUSE_S)
        self._compare(puppet, min(elapsed_s, PAUSE_S))
        self.positions[:], self.pose[:], self.world[:] = puppet.positions, puppet.pose, puppet.world
        self._time = frame.frame_time
        self._felt.take(puppet.positions, frame.frame_time, elapsed_s)

    def _compare(self, puppet: PuppetFrame, elapsed_s: float) -> None:
        """How far the joints that no hand holds are from the phrase; 0 while none is held."""
        answering = puppet.holds < HELD
        answering[ROOT] = False
        answer = 0.0
        if not answering[1:].all() and answering.any():
            apart = quaternion.angle_between(puppet.pose[answering], puppet.source[answering])
            answer = math.degrees(float(np.mean(apart)))
        self.answer += (answer - self.answer) * (1.0 - math.exp(-elapsed_s / SMOOTHING_S))

    def _settle(self, speeds: NDArray[np.float64], elapsed_s: float) -> None:
        self.speeds += (speeds - self.speeds) * (1.0 - math.exp(-elapsed_s / SMOOTHING_S))
        self.body_speed = float(self.speeds.mean())


class Felt:
    """FEATURES of one thing that moves, smoothed; measured as soon as a rule has read one."""

    def __init__(self, make: Callable[[], MotionFeatures | TurnFeatures]) -> None:
        self._make = make
        self._features: MotionFeatures | TurnFeatures | None = None
        self._smoothed: dict[str, float] = dict.fromkeys(FEATURES, 0.0)

    def read(self, name: str) -> float:
        """The present value; 0 at the first call."""
        self._features = self._features or self._make()
        return self._smoothed[name]

    def take(self, moving: Floats, seconds: float, elapsed_s: float) -> None:
        """Positions (J, 3), metres, or a hand's orientation (4,), zeros: unknown; at a later time."""
        if self._features is None:
            return
        if self._features.take_frame(moving, seconds):
            self._ease({name: float(self._features.numbers[name][0]) for name in FEATURES}, elapsed_s)
        else:
            self.rest()

    def begin_anew(self) -> None:
        """A jump: what was before does not count."""
        self._features = self._features and self._make()

    def rest(self) -> None:
        """Ease all features towards stillness: the dance pauses."""
        self._ease(dict.fromkeys(FEATURES, 0.0), PAUSE_S)

    def _ease(self, numbers: Mapping[Any, float], elapsed_s: float) -> None:
        share = 1.0 - math.exp(-elapsed_s / SMOOTHING_S)
        for name, number in numbers.items():
            self._smoothed[name] += (number - self._smoothed[name]) * share


def turn(q: NDArray[np.float64], axis: tuple[float, float, float]) -> float:
    """Degrees, -180..180, by which an orientation (w, x, y, z) turns about an axis: its twist."""
    w, x, y, z = q.tolist()
    along = x * axis[0] + y * axis[1] + z * axis[2]
    angle = math.degrees(2.0 * math.atan2(along, w))
    return (angle + 180.0) % 360.0 - 180.0


def lean(q: NDArray[np.float64], axis: tuple[float, float, float]) -> float:
    """Degrees, 0..180, by which an orientation (w, x, y, z) tips an axis from its rest."""
    tipped = quaternion.rotate(q, np.array(axis))
    return math.degrees(math.acos(min(max(float(tipped @ np.array(axis)), -1.0), 1.0)))
