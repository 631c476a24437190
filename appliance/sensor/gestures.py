"""Gestures of a hand, learned from three repetitions: dynamic time warping of how it turns.

A stretch of a hand's orientations becomes POINTS points, however long it took. Each is how far the hand has
turned since its start, how it turns, and where up is, all in the hand's own axes: so neither heading nor
tempo matters. Distances are relative to the size of the gesture. Sakoe and Chiba, 'Dynamic programming
algorithm optimization for spoken word recognition' (IEEE Trans. ASSP 26, 1978).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion

RATE_HZ = 25.0  # orientations that are looked at
LOOK_EVERY = 3  # orientations
POINTS = 20
BAND = 3  # points by which two repetitions may be out of step
TEMPI = (0.82, 1.0, 1.22)  # times the repetitions' tempo
REPETITIONS = 3
SHORTEST_S, LONGEST_S = 0.4, 4.0
MOVES_RAD_S, RESTS_RAD_S, RESTS_S = 0.7, 0.4, 0.4  # where a repetition begins and ends
TURNING, UP = 0.25, 0.7  # weights beside how far the hand has turned
LOOSE, LEAST_LOOSE = (
    2.0,
    1.25,
)  # times the distance between repetitions: the bound, at most and least
MOST_UNLIKE = 0.6  # repetitions that are farther apart are refused
CLEAR = 0.8  # times the least distance of ordinary motion
AGAIN_S = 1.0  # after a gesture nothing counts for so long

Floats = NDArray[np.float32]


@dataclass
class Gesture:
    """takes: its repetitions, orientations (N, 4) at RATE_HZ; within: the distance that counts; cue: that it
    calls; hand: the joint of the hand that makes it.
    """

    name: str
    cue: str
    hand: str
    takes: tuple[Floats, ...]
    within: float
    templates: Floats = field(init=False, repr=False)  # (K, POINTS, F)

    def __post_init__(self) -> None:
        self.templates = np.concatenate([points_of(take[None]) for take in self.takes])

    @property
    def lengths(self) -> list[int]:
        """How many orientations it may take, by its tempi."""
        mean = float(np.mean([len(take) for take in self.takes]))
        return sorted({max(4, round(mean / tempo)) for tempo in TEMPI})


def learned(
    name: str, cue: str, hand: str, takes: Sequence[Floats], background: Floats | None = None
) -> Gesture:
    """A gesture of these repetitions; background (N, 4): ordinary motion of the hand, which is not to count.

    Raises ValueError where the repetitions are too unlike, or too like ordinary motion.
    """
    gesture = Gesture(name, cue, hand, tuple(takes), 0.0)
    own = max(
        float(np.delete(distances(points_of(take[None]), gesture.templates)[0], place).min())
        for place, take in enumerate(takes)
    )
    if own > MOST_UNLIKE:
        raise ValueError(
            "The three repetitions are too unlike each other. Make the gesture three times alike."
        )
    gesture.within = min(LOOSE * own, MOST_UNLIKE)
    if background is not None and len(background) > max(gesture.lengths):
        clear = CLEAR * float(nearest(gesture, background).min())
        gesture.within = max(min(gesture.within, clear), LEAST_LOOSE * own)
    return gesture


def points_of(stretches: Floats) -> Floats:
    """Stretches of orientations (B, N, 4) as points (B, POINTS, 10)."""
    count = stretches.shape[1]
    at = np.linspace(0.0, count - 1.0, POINTS)
    before = np.minimum(at.astype(int), max(count - 2, 0))
    share = (at - before)[:, None]
    first = stretches[:, before]
    second = quaternion.aligned(stretches[:, np.minimum(before + 1, count - 1)], first)
    found = quaternion.normalize(first + share * (second - first))
    turned = quaternion.continuous(quaternion.multiply(quaternion.inverse(found[:, :1]), found), axis=1)
    turned = np.where(turned[:, :1, :1] < 0, -turned, turned)
    steps = quaternion.multiply(quaternion.inverse(found[:, :-1]), found[:, 1:])
    steps = 2.0 * (POINTS - 1) * np.where(steps[..., :1] < 0, -steps, steps)[..., 1:]
    steps = np.concatenate([steps[:, :1], steps], axis=1)
    up = quaternion.rotate(quaternion.inverse(found), np.array([0.0, 1.0, 0.0]))
    return np.concatenate([2.0 * turned, TURNING * steps, UP * up], axis=-1).astype(np.float32)


def distances(points: Floats, templates: Floats) -> Floats:
    """Distances of points (B, POINTS, F) from templates (K, POINTS, F): (B, K), in sizes of a template."""
    apart = (
        np.sum(points**2, axis=-1)[:, None, :, None]
        + np.sum(templates**2, axis=-1)[None, :, None, :]
        - 2.0 * np.einsum("bif,kjf->bkij", points, templates)
    )
    cost = np.maximum(apart, 0.0)
    far = np.full(cost.shape[:2], np.inf, np.float32)
    above = [far] * (POINTS + 1)
    above[0] = np.zeros_like(far)
    for i in range(POINTS):
        row = [far] * (POINTS + 1)
        for j in range(max(0, i - BAND), min(POINTS, i + BAND + 1)):
            row[j + 1] = np.minimum(np.minimum(above[j], above[j + 1]), row[j]) + cost[:, :, i, j]
        above = row
    moving = templates[..., :7] - np.array([2.0, *[0.0] * 6], np.float32)
    size = np.sum(moving**2, axis=(1, 2))
    found: Floats = np.sqrt(above[POINTS] / np.maximum(size, 1e-6))
    return found


def nearest(gesture: Gesture, stream: Floats) -> Floats:
    """How near a stream of orientations (N, 4) is to the gesture, for each of them as its last one (N,);
    infinite where nobody looks.
    """
    found = np.full(len(stream), np.inf, np.float32)
    for count in gesture.lengths:
        if count > len(stream):
            continue
        windows = np.lib.stride_tricks.sliding_window_view(stream, count, axis=0).swapaxes(1, 2)
        looked = np.arange((1 - count) % LOOK_EVERY, len(windows), LOOK_EVERY)
        for first in range(0, len(looked), 1000):
            some = looked[first : first + 1000]
            part = distances(points_of(windows[some]), gesture.templates).min(axis=1)
            at = some + count - 1
            found[at] = np.minimum(found[at], part)
    return found


class TurningPoint:
    """Finds where a gesture that is near enough does not come nearer any more."""

    def __init__(self) -> None:
        self._before: tuple[float, Gesture] | None = None
        self._waits_until = -math.inf

    def reached(self, near: float, gesture: Gesture, now: float) -> Gesture | None:
        """The nearest gesture of this look, 1 being near enough; the one that has been made."""
        if now < self._waits_until:
            return None
        before, self._before = self._before, (near, gesture) if near < 1.0 else None
        if before is None or near < before[0]:
            return None
        self._before, self._waits_until = None, now + AGAIN_S
        return before[1]


class Recogniser:
    """Looks for gestures in the orientations of one hand, one at a time."""

    def __init__(self) -> None:
        self.gestures: tuple[Gesture, ...] = ()
        self._stream = np.zeros((int(LONGEST_S / min(TEMPI) * RATE_HZ) + 1, 4), np.float32)
        self._known = 0
        self._takes = 0
        self._turning = TurningPoint()

    def take(self, orientation: Floats, now: float) -> Gesture | None:
        """The next orientation (4,), 1 / RATE_HZ after the one before; the gesture that it ends."""
        self._stream[:-1] = self._stream[1:]
        self._stream[-1] = orientation
        self._known = min(self._known + 1, len(self._stream))
        self._takes += 1
        if self._takes % LOOK_EVERY or not self.gestures:
            return None
        best = min(map(self._look, self.gestures), key=lambda one: one[0])
        return self._turning.reached(*best, now)

    def begin_anew(self) -> None:
        """Forget the orientations before: the stream was interrupted."""
        self._known, self._turning = 0, TurningPoint()

    def _look(self, gesture: Gesture) -> tuple[float, Gesture]:
        """How near it is, of what counts, and the gesture."""
        lengths = [count for count in gesture.lengths if count <= self._known]
        if not lengths:
            return math.inf, gesture
        points = np.concatenate([points_of(self._stream[None, -count:]) for count in lengths])
        return float(distances(points, gesture.templates).min()) / gesture.within, gesture


class Repetitions:
    """Finds the repetitions of a gesture between stillnesses. takes: those that have come."""

    def __init__(self) -> None:
        self.takes: list[Floats] = []
        self._moving: list[Floats] = []
        self._still = 0
        self._rested = False

    @property
    def is_done(self) -> bool:
        """Whether all have come."""
        return len(self.takes) >= REPETITIONS

    @property
    def moves(self) -> bool:
        """Whether one is being made."""
        return bool(self._moving) and self._rested

    def take(self, orientation: Floats, before: Floats) -> None:
        """The next orientation (4,), 1 / RATE_HZ after the one before."""
        speed = float(quaternion.angle_between(orientation, before)) * RATE_HZ
        self._still = self._still + 1 if speed < RESTS_RAD_S else 0
        rests = self._still >= RESTS_S * RATE_HZ
        if rests:
            end = len(self._moving) - self._still
            if self._rested and SHORTEST_S * RATE_HZ <= end <= LONGEST_S * RATE_HZ and not self.is_done:
                self.takes.append(np.array(self._moving[: end + 1], np.float32))
            self._moving, self._rested = [], True
        if self._moving or (speed > MOVES_RAD_S and self._rested):
            if not self._moving:
                self._moving.append(before.copy())
            self._moving.append(orientation.copy())
