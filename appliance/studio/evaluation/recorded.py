"""A dancer's recordings as the figures of a held dance need them; each part is made once, when needed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.studio.data.dataset import FPS, Take
from appliance.studio.evaluation.coupling import coupling
from appliance.studio.evaluation.coverage import RecordedMotion
from appliance.studio.evaluation.matching import MotionMatching
from appliance.studio.evaluation.motion_features import (
    Clips,
    clips_of,
    frechet_distance,
    geometric_features,
    kinetic_features,
)
from appliance.studio.evaluation.nearest import without_heading

COUPLED_TICKS, COUPLED_LEAST, COUPLED_MOST = 1200, 400, 16  # stretches whose coupling is measured


class Recorded:
    """The sound stretches of a dancer's takes."""

    def __init__(
        self, takes: Sequence[Take], joints: Sequence[str], other_dancer: Sequence[Take] = ()
    ) -> None:
        """joints: those that the network moves. other_dancer: takes of somebody else, the ceiling of FID."""
        self.joints = tuple(joints)
        self._takes, self._other = takes, other_dancer
        places = [takes[0].recording.skeleton.index(name) for name in joints]
        self._stretches: list[Array] = [
            take.recording.poses[first:end][:, places] for take in takes for first, end in take.sound_runs
        ]
        self._own_coupling: dict[str, Array] = {}

    @cached_property
    def matching(self) -> MotionMatching | None:
        """None where no stretch is long enough."""
        try:
            return MotionMatching(self._stretches)
        except ValueError:
            return None

    @cached_property
    def motion(self) -> RecordedMotion:
        return RecordedMotion(self._stretches)

    @cached_property
    def clips(self) -> tuple[Clips, Clips | None]:
        """Kinetic and geometric features of the recordings."""
        return _features(self._takes)

    def floor(self, count: int) -> tuple[float, float]:
        """FID, kinetic and geometric, of `count` clips of every other take against the other takes' clips."""
        halves = self._takes[0::2], self._takes[1::2]
        if not halves[1]:
            return float("nan"), float("nan")
        one, other = (_features(half) for half in halves)
        both = _fids(_some(one, count), other), _fids(_some(other, count), one)
        return (both[0][0] + both[1][0]) / 2, (both[0][1] + both[1][1]) / 2

    def ceiling(self, count: int) -> tuple[float, float]:
        """The same of the other dancer's clips against these recordings'; NaN without one."""
        if not self._other:
            return float("nan"), float("nan")
        return _fids(_some(_features(self._other), count), self.clips)

    def fid(self, skeleton: Skeleton, positions: Sequence[Array]) -> tuple[float, float]:
        """FID, kinetic and geometric, of dances, positions (T, J, 3) in metres, against the recordings."""
        return _fids(_features_of(skeleton, positions), self.clips)

    def own_coupling(self, joint: str) -> Array | None:
        """(M - 1,): coupling of the others to a joint in the recordings; None without stretches of 8 s."""
        if joint not in self._own_coupling:
            held = self.joints.index(joint)
            parts = [
                without_heading(stretch[begin : begin + COUPLED_TICKS])
                for stretch in self._stretches
                for begin in range(0, len(stretch) - COUPLED_LEAST, COUPLED_TICKS)
            ]
            chosen = np.unique(np.linspace(0, len(parts) - 1, min(COUPLED_MOST, len(parts))).astype(int))
            some = [parts[place] for place in chosen]
            if not some:
                return None
            dances = [np.delete(part, held, axis=1) for part in some]
            self._own_coupling[joint] = coupling(dances, [part[:, held] for part in some])
        return self._own_coupling[joint]


def positions_of(skeleton: Skeleton, poses: Array, roots: Array) -> Array:
    """(T, J, 3): world positions of poses (T, J, 4) with roots (T, 3), metres."""
    return skeleton.forward_kinematics(poses.astype(np.float32), roots.astype(np.float32))[0]


def _features(takes: Sequence[Take]) -> tuple[Clips, Clips | None]:
    skeleton = takes[0].recording.skeleton
    positions = [
        positions_of(skeleton, take.recording.poses[first:end], take.recording.roots[first:end])
        for take in takes
        for first, end in take.sound_runs
    ]
    return _features_of(skeleton, positions)


def _features_of(skeleton: Skeleton, positions: Sequence[Array]) -> tuple[Clips, Clips | None]:
    clips = [clip for part in positions for clip in clips_of(part, FPS)]
    return kinetic_features(skeleton, clips, FPS), geometric_features(skeleton, clips, FPS)


def _some(features: tuple[Clips, Clips | None], count: int) -> tuple[Clips, Clips | None]:
    """At most `count` clips, evenly: a smaller set is further from another one by chance."""
    chosen = np.unique(np.linspace(0, len(features[0]) - 1, min(count, len(features[0]))).astype(int))
    return features[0][chosen], None if features[1] is None else features[1][chosen]


def _fids(made: tuple[Clips, Clips | None], known: tuple[Clips, Clips | None]) -> tuple[float, float]:
    kinetic = float("nan")
    if made[0].shape[1:] == known[0].shape[1:]:
        kinetic = frechet_distance(made[0], known[0])
    if made[1] is None or known[1] is None:
        return kinetic, float("nan")
    return kinetic, frechet_distance(made[1], known[1])
