"""Capture errors: jumps, and stretches in which a joint stands where only swapped markers put it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bones import limb_ends, small_parts
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.jumps import Runs, bend_limits, bends, jumps, runs, visible

SNAP = 0.5  # fraction of a jump's limit: no error by itself, but it can put a joint into a wrong place
FAR_DEGREES = 110.0  # head, hand or foot from its usual orientation: no neck, wrist or ankle turns that far
AWAY_DEGREES = 60.0  # any other joint that jumps there and away again
GAP_DEGREES = 30.0  # to where the joint is at all other times: it never passes through here
PASSING_S = 0.5  # how long it may pass nearer, on the way there and back
TOUCHING_S = 0.1  # between a stretch and the jump that put the joint there
BLOCK = 256
SLACK_S = 0.02  # tolerance of seconds that were read from a picture

JUMP, APART, MARKED = "jump", "apart", "marked"
REASONS = {
    JUMP: "moves as no body does",
    APART: "stands as it does at no other time",
    MARKED: "masked by the catalogue",
}


@dataclass(frozen=True)
class CaptureError:
    """A stretch of a recording in seconds in which a joint is not what the dancer did. degrees: how far off.

    joint is empty where the whole figure is meant.
    """

    joint: str
    start_s: float
    end_s: float
    reason: str
    degrees: float = 0.0


def find_capture_errors(
    recordings: Sequence[Recording], moving: Sequence[int], usual: Mapping[int, Array] | None = None
) -> list[list[CaptureError]]:
    """Errors of each take of one dancer, at its recorded rate; moving: the joints to look at.

    A twitching finger or toe masks no frame: it is invisible, and gloves twitch all the time.
    usual: usual orientations (4,) by joint; the default is the mean over the takes.
    """
    if not recordings:
        return []
    skeleton = recordings[0].skeleton
    judged = [joint for joint in moving if joint not in small_parts(skeleton)]
    bent = [bends(recording.poses, recording.fps) for recording in recordings]
    given = list(zip(recordings, bent, bend_limits(bent), strict=True))
    jumped = [visible(one, _of(judged, jumps(one, bend, limit))) for one, bend, limit in given]
    snapped = [visible(one, _of(judged, jumps(one, bend, SNAP * limit))) for one, bend, limit in given]
    errors = [
        [_jump(recording, joint, *ends) for joint, found in one.items() for ends in found]
        for recording, one in zip(recordings, jumped, strict=True)
    ]
    ends = limb_ends(skeleton)
    for joint in judged:
        if joint:  # a root may have any orientation
            cuts = snapped if joint in ends else jumped
            looked_at = _Joint(recordings, joint, jumped, joint in ends, (usual or {}).get(joint))
            for stretch in looked_at.apart([one.get(joint, []) for one in cuts]):
                errors[stretch.take].append(looked_at.error(stretch))
    return [sorted(one, key=lambda error: error.start_s) for one in errors]


def without(errors: Sequence[CaptureError], kept: Sequence[tuple[float, float]]) -> list[CaptureError]:
    """The errors outside spans of seconds that are known to be sound."""
    left = list(errors)
    for start, end in kept:
        left = [
            replace(one, start_s=first, end_s=last)
            for one in left
            for first, last in _outside((one.start_s, one.end_s), start - SLACK_S, end + SLACK_S)
        ]
    return left


def _outside(span: tuple[float, float], start: float, end: float) -> list[tuple[float, float]]:
    if end < span[0] or span[1] < start:
        return [span]
    return [(first, last) for first, last in ((span[0], start), (end, span[1])) if first < last]


def sound_frames(count: int, fps: float, errors: Sequence[CaptureError]) -> NDArray[np.bool_]:
    """(count,): poses at `fps` that no error touches."""
    sound = np.ones(count, dtype=bool)
    for error in errors:
        sound[max(int(np.floor(error.start_s * fps)), 0) : int(np.ceil(error.end_s * fps)) + 1] = False
    return sound


@dataclass(frozen=True)
class _Stretch:
    """Frames first..end - 1 of a take between two cuts."""

    take: int
    first: int
    end: int


class _Joint:
    """One joint in all takes: its orientations, jumps, and distance from its usual orientation."""

    def __init__(
        self,
        recordings: Sequence[Recording],
        joint: int,
        jumped: Sequence[Mapping[int, Runs]],
        limb_end: bool,
        usual: Array | None,
    ) -> None:
        self.name, self.limb_end = recordings[0].skeleton.names[joint], limb_end
        self.fps = [recording.fps for recording in recordings]
        self.poses = [recording.poses[:, joint] for recording in recordings]
        self.jumped = [one.get(joint, []) for one in jumped]
        self.usual = _mean(self.poses, self.jumped) if usual is None else usual
        self.away = [np.degrees(quaternion.angle_between(q, self.usual)) for q in self.poses]
        self.far = FAR_DEGREES if limb_end else AWAY_DEGREES

    def apart(self, cuts: Sequence[Runs]) -> list[_Stretch]:
        """The stretches between cuts in which the joint is wrong throughout, with the way there and back."""
        stretches = [
            _Stretch(take, first, end)
            for take, here in enumerate(cuts)
            for first, end in runs(_free(here, len(self.poses[take])))
        ]
        suspects = [one for one in stretches if self._is_suspect(one)]
        if not suspects:
            return []
        others = [one for one in stretches if one not in suspects]
        rest = np.concatenate([self.usual[None], *map(self._few, others)])
        wrong = [one for one in suspects if self._is_put(one) or self._gap(one, rest) > GAP_DEGREES]
        return [self._fitted(one) for one in wrong]

    def error(self, one: _Stretch) -> CaptureError:
        fps, away = self.fps[one.take], self.away[one.take][one.first : one.end]
        return CaptureError(self.name, one.first / fps, (one.end - 1) / fps, APART, float(np.median(away)))

    def _is_suspect(self, one: _Stretch) -> bool:
        return bool(np.median(self.away[one.take][one.first : one.end]) > self.far) and (
            self.limb_end or len(self.jumped[one.take]) > 0
        )

    def _is_put(self, one: _Stretch) -> bool:
        """Whether a jump put the end of a limb beyond what a body can do."""
        near = TOUCHING_S * self.fps[one.take]
        return self.limb_end and any(
            abs(last - one.first) <= near or abs(first - one.end) <= near
            for first, last in self.jumped[one.take]
        )

    def _few(self, one: _Stretch) -> Array:
        """Orientations ten times a second: what passes within PASSING_S counts little."""
        return self.poses[one.take][one.first : one.end : max(1, round(self.fps[one.take] / 10))]

    def _gap(self, one: _Stretch, rest: Array) -> float:
        """How far from this stretch the joint stays at all other times but PASSING_S of them."""
        near = np.zeros(len(rest))
        few = self._few(one)
        for at in range(0, len(few), BLOCK):
            near = np.maximum(near, np.abs(few[at : at + BLOCK] @ rest.T).max(axis=0))
        passing = min(round(10 * PASSING_S), len(rest) - 1)
        return float(np.degrees(2 * np.arccos(min(np.sort(near)[-1 - passing], 1.0))))

    def _fitted(self, one: _Stretch) -> _Stretch:
        """The stretch; for the end of a limb, exactly the frames in which it is too far."""
        if not self.limb_end:
            return one
        far = self.away[one.take] > self.far
        first, end = one.first + int(np.argmax(far[one.first :])), one.end
        while not far[end - 1]:
            end -= 1
        while first > 0 and far[first - 1]:
            first -= 1
        while end < len(far) and far[end]:
            end += 1
        return _Stretch(one.take, first, end)


def _of(moving: Sequence[int], found: Mapping[int, Runs]) -> dict[int, Runs]:
    return {joint: found[joint] for joint in moving if joint in found}


def _jump(recording: Recording, joint: int, first: int, last: int) -> CaptureError:
    q, fps = recording.poses[first : last + 1, joint], recording.fps
    degrees = np.degrees(quaternion.angle_between(q, q[:1])).max()
    return CaptureError(recording.skeleton.names[joint], first / fps, last / fps, JUMP, float(degrees))


def _free(cuts: Sequence[tuple[int, int]], count: int) -> NDArray[np.bool_]:
    free = np.ones(count, dtype=bool)
    for first, last in cuts:
        free[first : last + 1] = False
    return free


def _mean(poses: Sequence[Array], jumped: Sequence[Sequence[tuple[int, int]]]) -> Array:
    """Usual orientation: the mean (Markley et al. 2007) of all that is not far from the overall mean."""
    q = np.concatenate([one[_free(cuts, len(one))] for one, cuts in zip(poses, jumped, strict=True)])
    mean: Array = np.linalg.eigh(q.T @ q)[1][:, -1]
    near = np.degrees(quaternion.angle_between(q, mean)) <= FAR_DEGREES
    if near.any():
        mean = np.linalg.eigh(q[near].T @ q[near])[1][:, -1]
    return mean
