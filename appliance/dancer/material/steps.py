"""A dance as steps of 80 ms: a window's latent and the root's displacement each; and back to motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.grounding import sole_positions
from appliance.dancer.loop import turns_about_y, yaws
from appliance.dancer.material.latent_paths import Latents
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

WINDOW = 8  # poses of a window
HOP = 4  # frames from one step to the next: 12.5 steps a second, half a window, so that two windows overlap
MIDDLE = WINDOW // 2  # the frame of a window whose heading and place count as the window's own
ROOT = 4  # numbers besides the latent: displacement x and z, turn, height
AT_ONCE = 64  # windows: all of a minute at once take 50 MB
FLOOR_FRAMES = 150  # the floor of a recording drifts by centimetres within seconds: its window
FLOOR_PERCENTILE = 30.0


class Coder(Protocol):
    """An autoencoder of windows of 8 poses."""

    @property
    def latent(self) -> int:
        """Numbers of a latent."""

    def encode(self, windows: NDArray[np.float32]) -> tuple[Latents, Array]:
        """Windows (W, 8, M, 4) -> latents (W, Z), and where each of them faces (W, 4)."""

    def decode(self, latents: Latents) -> NDArray[np.float32]:
        """Latents (W, Z) -> windows (W, 8, M, 4) that face ahead, not yet of unit length."""


@dataclass(frozen=True)
class Steps:
    """A stretch of dance: latents (T, Z); ways (T, 4).

    ways: how far the root came since the step before, in metres to its left and ahead (in the heading of that
    step), by how much it turned (radians about +Y), and its height above the floor in metres.
    """

    latents: NDArray[np.float32]
    ways: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.latents)

    @property
    def features(self) -> NDArray[np.float32]:
        """(T, Z + 4)."""
        return np.concatenate([self.latents, self.ways], axis=1)

    @staticmethod
    def of_features(features: NDArray[np.float32]) -> Steps:
        return Steps(features[:, :-ROOT], features[:, -ROOT:])


def steps_of(coder: Coder, recording: Recording, moving: Sequence[int]) -> Steps:
    """Steps of one recording at 50 Hz. The first window only says where the first step comes from."""
    count = (len(recording) - WINDOW) // HOP + 1
    if count < 2:
        return Steps(np.zeros((0, coder.latent), np.float32), np.zeros((0, ROOT), np.float32))
    starts = HOP * np.arange(count)
    poses = recording.poses[:, list(moving)].astype(np.float32)
    latents, _ = coder.encode(poses[starts[:, None] + np.arange(WINDOW)])
    return Steps(latents[1:], ways_of(recording, starts + MIDDLE))


def ways_of(recording: Recording, at: NDArray[np.int_]) -> NDArray[np.float32]:
    """(T - 1, 4): the root's ways between T frames, see Steps."""
    heading = np.unwrap(yaws(quaternion.heading(recording.poses[at, 0])))
    moved = np.diff(recording.roots[at], axis=0)
    moved = quaternion.rotate(turns_about_y(-heading[:-1]), moved)
    height = (recording.roots[:, 1] - floor_under(recording))[at]
    return np.stack([moved[:, 0], moved[:, 2], np.diff(heading), height[1:]], axis=1).astype(np.float32)


def floor_under(recording: Recording) -> Array:
    """Height of the floor (N,) in metres under each frame: where the lowest points of soles mostly are."""
    lowest = sole_positions(recording.skeleton, recording.poses, recording.roots)[..., 1].min(axis=1)
    half = FLOOR_FRAMES // 2
    padded = np.pad(lowest, half, mode="reflect" if len(lowest) > half else "edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    level = np.percentile(around, FLOOR_PERCENTILE, axis=1)
    smooth = np.hanning(half + 2)[1:-1]
    floor: Array = np.convolve(np.pad(level, half // 2, mode="edge"), smooth / smooth.sum(), "same")
    return floor[half // 2 : len(level) + half // 2]


def motion_of(coder: Coder, steps: Steps, still_pose: Array, moving: Sequence[int]) -> tuple[Array, Array]:
    """Poses (N, J, 4) and roots (N, 3) at 50 Hz of T steps, N = 4 * (T - 1): the first and last half window,
    which only one window knows, are left out.

    still_pose (J, 4): how the joints stand that the autoencoder does not know.
    """
    heading = np.cumsum(steps.ways[:, 2].astype(np.float64))
    share = np.sin(np.pi * (np.arange(HOP) + 0.5) / WINDOW) ** 2
    poses = np.tile(np.asarray(still_pose, np.float64), (HOP * (len(steps) - 1), 1, 1))
    for first in range(0, len(steps) - 1, AT_ONCE):
        some = slice(first, first + AT_ONCE + 1)
        turned = quaternion.normalize(coder.decode(steps.latents[some]).astype(np.float64))
        turned[:, :, 0] = quaternion.multiply(turns_about_y(heading[some])[:, None], turned[:, :, 0])
        earlier = turned[:-1, HOP:].reshape(-1, len(moving), 4)
        later = turned[1:, :HOP].reshape(-1, len(moving), 4)
        between = quaternion.slerp(earlier, later, np.tile(share, len(turned) - 1)[:, None])
        poses[HOP * first : HOP * first + len(between), list(moving)] = between
    return quaternion.continuous(poses), path_along(steps.ways, heading, HOP)


def danced_again(coder: Coder, poses: Array, moving: Sequence[int], cyclic: bool = False) -> Array:
    """Poses (N, J, 4) seen through the autoencoder at every frame: each the Hann-weighted mean of the 8
    windows that know it. It suppresses tremors where two steps meet, which no dancer does.

    cyclic: the last frame leads into the first; otherwise the ends are known by fewer windows.
    """
    count = len(poses)
    around = np.arange(count + WINDOW - 1 if cyclic else count) % count
    reference = poses[:, list(moving)][around]
    windows = np.lib.stride_tricks.sliding_window_view(reference, WINDOW, axis=0)
    total = np.zeros_like(reference)
    hann = np.sin(np.pi * (np.arange(WINDOW) + 0.5) / WINDOW) ** 2
    for first in range(0, len(windows), AT_ONCE):
        some = np.moveaxis(windows[first : first + AT_ONCE], -1, 1)
        latents, facing = coder.encode(some.astype(np.float32))
        made = quaternion.normalize(coder.decode(latents).astype(np.float64))
        made[:, :, 0] = quaternion.multiply(facing[:, None].astype(np.float64), made[:, :, 0])
        for place, weight in enumerate(hann, first):
            rows = slice(place, place + len(made))
            total[rows] += weight * quaternion.aligned(made[:, place - first], reference[rows])
    if cyclic:
        total[: WINDOW - 1] += quaternion.aligned(total[count:], reference[: WINDOW - 1])
    mean, again = total[:count], poses.copy()
    mean /= np.sqrt(np.einsum("njk,njk->nj", mean, mean))[..., None]
    again[:, list(moving)] = mean
    del mean, total, reference, windows  # a minute of each is some MB
    return quaternion.continuous(again)


def path_along(ways: NDArray[np.float32], heading: Array, between: int) -> Array:
    """Roots (between * (T - 1), 3) from the first step on: a smooth curve through the steps (T, 4)."""
    moved = np.zeros((len(ways), 3))
    moved[1:, 0], moved[1:, 2] = ways[1:, 0], ways[1:, 1]
    moved[1:] = quaternion.rotate(turns_about_y(heading[:-1]), moved[1:])
    knots = np.cumsum(moved, axis=0)
    knots[:, 1] = ways[:, 3]
    return smooth_curve(knots, between)


def smooth_curve(knots: Array, between: int) -> Array:
    """Cubic curve (Catmull-Rom) through knots (T, D): (between * (T - 1), D) points, not the last knot."""
    padded = np.concatenate([2 * knots[:1] - knots[1:2], knots, 2 * knots[-1:] - knots[-2:-1]])
    slopes = (padded[2:] - padded[:-2]) / 2
    t = (np.arange(between) / between)[None, :, None]
    a, b, da, db = knots[:-1, None], knots[1:, None], slopes[:-1, None], slopes[1:, None]
    t2, t3 = t * t, t * t * t
    curve = (2 * t3 - 3 * t2 + 1) * a + (t3 - 2 * t2 + t) * da + (3 * t2 - 2 * t3) * b + (t3 - t2) * db
    points: Array = curve.reshape(-1, knots.shape[1])
    return points
