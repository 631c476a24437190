"""Recording: a sequence of poses at a known rate, from motion capture or made by a network."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

TPOSE_SEARCH_FRAMES = 10
TPOSE_JUMP_DEGREES = 25.0  # a step like this among the first frames leaves a rest pose
TPOSE_SETTLED_DEGREES = 10.0  # filters ring after the jump: 94, 27, 24, 17, 7, 1 degrees in CMU's salsa


@dataclass(frozen=True, eq=False)
class Recording:
    """poses (N, J, 4) local unit quaternions without sign jumps; roots (N, 3) metres; fps in poses a second.

    translations (N, J, 3) metres only where bones change their length over time, else None. notes: what of
    its file was left out or taken for something else than it says, and where, in words.
    """

    skeleton: Skeleton
    poses: Array
    roots: Array
    fps: float
    translations: Array | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def seconds(self) -> float:
        return len(self) / self.fps

    def without_first(self, frames: int) -> Recording:
        """The same recording without its first frames (a T-pose, for example)."""
        return self._frames(np.arange(min(frames, len(self)), len(self)))

    def excerpt(self, start_s: float, end_s: float | None = None) -> Recording:
        """The part from start_s up to end_s (seconds; None: to the end)."""
        last = len(self) if end_s is None else min(round(end_s * self.fps), len(self))
        return self._frames(np.arange(min(round(start_s * self.fps), last), last))

    def resampled(self, fps: float) -> Recording:
        """The same motion at another rate: rotations by SLERP, positions straight between frames."""
        if fps == self.fps or len(self) < 2:
            return replace(self, fps=fps)
        count = int(np.floor((len(self) - 1) * fps / self.fps + 1e-9)) + 1
        at = np.minimum(np.arange(count) * self.fps / fps, len(self) - 1)
        return replace(self.between(at), fps=fps)

    def spread(self, frames: NDArray[np.intp]) -> Recording:
        """The same poses as frames of these rising numbers; the figure turns evenly over those between."""
        if len(frames) < 2 or frames[-1] - frames[0] == len(frames) - 1:
            return self
        return self.between(np.interp(np.arange(frames[0], frames[-1] + 1), frames, np.arange(len(frames))))

    def between(self, at: Array) -> Recording:
        """Poses at places among the frames: rotations by SLERP, positions straight between two."""
        before = np.minimum(at.astype(int), len(self) - 2)
        share = at - before
        poses = quaternion.slerp(self.poses[before], self.poses[before + 1], share[:, None])

        def straight(values: Array) -> Array:
            weight = share.reshape(-1, *[1] * (values.ndim - 1))
            mixed: Array = (1 - weight) * values[before] + weight * values[before + 1]
            return mixed

        return replace(
            self,
            poses=quaternion.continuous(poses),
            roots=straight(self.roots),
            translations=None if self.translations is None else straight(self.translations),
        )

    def _frames(self, chosen: NDArray[np.intp]) -> Recording:
        translations = None if self.translations is None else self.translations[chosen]
        return replace(self, poses=self.poses[chosen], roots=self.roots[chosen], translations=translations)


def leading_tpose_frames(recording: Recording) -> int:
    """The number of frames at the start that are a rest pose or the swing away from it."""
    head = recording.poses[: TPOSE_SEARCH_FRAMES + 1]
    steps = np.degrees(quaternion.angle_between(head[1:], head[:-1])).max(axis=-1)
    if not (steps > TPOSE_JUMP_DEGREES).any():
        return 0
    return int(np.flatnonzero(steps > TPOSE_SETTLED_DEGREES)[-1]) + 1
