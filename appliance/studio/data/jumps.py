"""Jumps: motion that no body makes, recognised by its speed and by sudden changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

SPAN_S = 1 / 30  # motions are compared over this time at any rate: a one-frame error counts alike
# Two motions that follow each other and differ by more than this are a jump: what the dancer's own sharpest
# 1 % allows, between two bounds. Measured in degrees: clean salsa and Indian dance reach 44 (a hand), martial
# arts 65 (a shin in a kick); swapped markers begin at 34 (a hip), 43 (a neck), 57 (a foot).
LEAST_DEGREES, MOST_DEGREES, CALM_DEGREES, TIMES_SHARP = 30.0, 80.0, 20.0, 3.2
FASTEST, FASTEST_S = 2200.0, 1 / 60  # degrees a second over this time: a fighter's wrist reaches 2020
SEEN_DEGREES, SEEN_OF_HEIGHT = 12.0, 0.05  # bends; a twist that the arm hands to the wrist shows 8 and 0.04
FAST = 0.3  # fraction of a jump's fastest step: the steps next to it that belong to it


Runs = list[tuple[int, int]]


def bends(poses: Array, fps: float) -> NDArray[np.float32]:
    """(N, J): degrees by which the motion of orientations (N, J, 4) in the SPAN_S after each frame differs
    from that in the SPAN_S before it."""
    span = _frames(SPAN_S, fps)
    if len(poses) <= span:
        return np.zeros(poses.shape[:2], dtype=np.float32)
    turns = quaternion.multiply(poses[span:], quaternion.inverse(poses[:-span]))
    axis, angle = quaternion.to_axis_angle(turns)
    return _bent(np.degrees(axis * angle[..., None]), len(poses), span)


def bend_limits(bent: Sequence[NDArray[np.float32]]) -> list[NDArray[np.float64]]:
    """For each take (J,): degrees above which a bend is a jump, derived from what the dancer does.

    That is from the sharpest 1 % of all takes, and up to twice as much for a take that is sharp for a
    twentieth of its time: a fight among waltzes is no error.
    """
    sharp = np.percentile(np.concatenate(bent), 99, axis=0)
    own = [np.clip(2 * np.percentile(take, 95, axis=0), sharp, 2 * sharp) for take in bent]
    return [np.clip(CALM_DEGREES + TIMES_SHARP * one, LEAST_DEGREES, MOST_DEGREES) for one in own]


def jumps(recording: Recording, bent: NDArray[np.float32], limits: NDArray[np.float64]) -> dict[int, Runs]:
    """By joint the first and last frame of each jump; recording at its recorded rate."""
    span = _frames(SPAN_S, recording.fps)
    too_fast, sharp = _too_fast(recording), bent > limits
    found = {}
    for joint in np.flatnonzero(sharp.any(axis=0) | too_fast.any(axis=0)):
        q = recording.poses[:, joint]
        steps = np.degrees(quaternion.angle_between(q[1:], q[:-1]))
        moving = too_fast[:, joint]
        for first, end in runs(moving):
            _mark(moving, steps, first, end)
        for frame in np.flatnonzero(sharp[:, joint]):
            _mark(moving, steps, max(int(frame) - span, 0), min(int(frame) + span, len(steps)))
        found[int(joint)] = runs(moving)
    return found


def visible(recording: Recording, found: Mapping[int, Runs]) -> dict[int, Runs]:
    """Jumps that are visible. A twist that a solver shifts from one joint to the next (from an arm to its
    hand) moves nothing: it comes from the computation, not from the capture.
    """
    if not found:
        return {}
    skeleton, fps, span = recording.skeleton, recording.fps, _frames(SPAN_S, recording.fps)
    poses = np.array(recording.poses)
    poses[:, 0] = quaternion.IDENTITY
    places, world = skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
    turning = bends(world, fps)
    least_m = SEEN_OF_HEIGHT * float(np.ptp(places[0], axis=0).max())
    shown: dict[int, Runs] = {}
    for joint, jumped in found.items():
        below = skeleton.descendants(joint)
        ends = [one for one in below if one not in skeleton.parents]
        reach = places[:, below] - places[:, [joint]]
        moved = _bent(reach[span:] - reach[:-span], len(reach), span).max(axis=1) > least_m
        seen = moved | (turning[:, ends].max(axis=1) > SEEN_DEGREES) | (joint == 0)
        shown[joint] = [run for run in jumped if seen[max(run[0] - span, 0) : run[1] + span + 1].any()]
    return {joint: left for joint, left in shown.items() if left}


def runs(flags: NDArray[np.bool_]) -> Runs:
    """First and last + 1 of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _bent(ways: Array, count: int, span: int) -> NDArray[np.float32]:
    """(count, ...): difference between the displacement (count - span, ..., 3) from and to each frame."""
    bent = np.zeros((count, *ways.shape[1:-1]), dtype=np.float32)
    if len(ways) > span:
        bent[span:-span] = np.linalg.norm(ways[span:] - ways[:-span], axis=-1)
    return bent


def _mark(moving: NDArray[np.bool_], steps: Array, first: int, last: int) -> None:
    """Mark the fast steps among first..last - 1, and adjacent ones that are as fast."""
    least = FAST * steps[first:last].max()
    moving[first:last] |= steps[first:last] >= least
    while first > 0 and moving[first] and steps[first - 1] >= least:
        first -= 1
        moving[first] = True
    while last < len(steps) and moving[last - 1] and steps[last] >= least:
        moving[last] = True
        last += 1


def _too_fast(recording: Recording) -> NDArray[np.bool_]:
    """(N - 1, J): steps that are part of a turn faster than any body turns."""
    span, q = _frames(FASTEST_S, recording.fps), recording.poses
    too_fast = np.zeros((max(len(q) - 1, 0), q.shape[1]), dtype=bool)
    if len(q) > span:
        turned = np.degrees(quaternion.angle_between(q[span:], q[:-span]))
        for later in range(span):
            too_fast[later : later + len(turned)] |= turned > FASTEST * span / recording.fps
    return too_fast


def _frames(seconds: float, fps: float) -> int:
    return max(1, round(seconds * fps))
