"""Figures of a dance: energy, roughness and steps of its motion; arms in trunk and arm, sliding feet."""

from __future__ import annotations

import numpy as np

from appliance.dancer.grounding import Floor, Grounding, GroundingError, survey
from appliance.dancer.trunk import Trunk
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.standing import measure_standing

ROUGHNESS_PERCENTILE = DEPTH_PERCENTILE = 99.0
ALONG_BONE = np.linspace(0.0, 1.0, 9)
DEEP = 0.3  # of that radius below the surface: 3.5 cm
TOUCHING_M = 0.03  # between the axes of two arms
ALONG_ARM = (0.5, 0.75, 1.0)  # of the upper arm: its inner half begins in the trunk


def degrees_apart(a: Array, b: Array) -> Array:
    """(T,): mean joint angle between poses (T, M, 4)."""
    apart: Array = np.degrees(quaternion.angle_between(a, b)).mean(axis=-1)
    return apart


def energy(poses: Array) -> float:
    """Mean joint speed of poses (T, M, 4), degrees a tick."""
    return float(_steps(poses).mean())


def largest_step(poses: Array) -> float:
    """The largest angle of any joint from one tick to the next, degrees."""
    return float(_steps(poses).max())


def roughness(poses: Array) -> float:
    """99th percentile of the angular acceleration over ticks and joints, degrees a tick squared.

    A joint's angular velocity is the axis of its step times the angle, in the parent's frame.
    """
    turns = quaternion.multiply(poses[1:], quaternion.inverse(poses[:-1]))
    axes, angles = quaternion.to_axis_angle(turns)
    velocities = axes * np.degrees(angles)[..., None]
    accelerations = np.linalg.norm(np.diff(velocities, axis=0), axis=-1)
    return float(np.percentile(accelerations, ROUGHNESS_PERCENTILE))


class BodyFigures:
    """The figures of dances on one phrase and its floor; NaN if joint names do not identify the body parts.

    The trunk is a tube along the spine from hip to neck, its radius half the distance between the shoulders.
    An upper arm is deep in it where the axis of its outer half is more than 0.3 radii below the surface.
    Release 0.1.0 on salsa_29 with hands of salsa_24 on lShldr at 10/9: 6 to 11 % of the ticks; the phrase
    2 %. Foot skate is the horizontal speed of the lowest point of the soles, grounded as on stage: 0.14 m/s
    there, 0.06 in the phrase; 0.07 and 0.02 on the default show's own phrase.
    """

    def __init__(self, phrase: Recording) -> None:
        self._recording, self._skeleton = phrase, phrase.skeleton
        self._trunk = Trunk.of(phrase.skeleton)
        self._floor: Floor | None
        try:
            self._floor = survey(phrase)
        except GroundingError:
            self._floor = None

    def arm_in_trunk(self, poses: Array) -> float:
        """Share of poses (T, J, 4) in which an upper arm is deep in the trunk."""
        depths = self._arm_depths(poses)
        return float("nan") if depths is None else float((depths > DEEP).mean())

    def arm_depth_cm(self, poses: Array) -> float:
        """How far an upper arm's axis is below the trunk's surface in the deepest of a hundred poses, cm."""
        depths = self._arm_depths(poses)
        if self._trunk is None or depths is None:
            return float("nan")
        return 100 * self._trunk.radius_m * float(np.percentile(depths, DEPTH_PERCENTILE))

    def arms_touch(self, poses: Array) -> float:
        """Share of poses (T, J, 4) in which upper arm or forearm are nearer than 3 cm to the other arm's."""
        if self._trunk is None:
            return float("nan")
        positions, _ = self._skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
        left, right = (
            [
                (positions[:, arm.shoulder], positions[:, arm.elbow]),
                (positions[:, arm.elbow], positions[:, arm.wrist]),
            ]
            for arm in self._trunk.arms
        )
        nearest: Array = np.full(len(poses), np.inf)
        for one, other in ((one, other) for one in left for other in right):
            for bone, points in ((one, other), (other, one)):
                for share in ALONG_BONE:
                    point = (1 - share) * points[0] + share * points[1]
                    nearest = np.minimum(nearest, _distance(point, *bone))
        return float((nearest < TOUCHING_M).mean())

    def foot_skate(self, poses: Array, roots: Array) -> float:
        """Sliding speed of the supporting foot, m/s, in grounded poses (T, J, 4) with roots (T, 3)."""
        if self._floor is None or len(poses) < 2:
            return float("nan")
        lifts = self._floor.lifts[: len(poses)]
        return measure_standing(self._skeleton, poses, roots, self._floor, lifts).slide_cm_s / 100

    def grounded(self, poses: Array, held: str | None = None, locked: bool = True) -> tuple[Array, Array]:
        """Poses (T, J, 4) and roots (T, 3) in metres as on stage: feet locked, arms out of the trunk.

        held: the joint that a hand holds; locked False: legs as they are.
        """
        path = self._recording.roots[: len(poses)].astype(np.float32)
        if self._floor is None:
            return poses, path
        weights = np.array([name == held for name in self._skeleton.names], dtype=np.float32)
        grounding = Grounding(self._skeleton, self._floor)
        standing, roots = np.empty(poses.shape, np.float32), np.empty_like(path)
        for tick, pose in enumerate(poses.astype(np.float32)):
            lift = float(self._floor.lifts[tick])
            grounding.ground_pose(pose, path[tick], lift, held=weights if locked else None)
            standing[tick], roots[tick] = grounding.pose, grounding.root
        return standing, roots

    def _arm_depths(self, poses: Array) -> Array | None:
        """(T,): how far the deepest upper arm is below the trunk's surface, in its radii; 0 outside."""
        if self._trunk is None:
            return None
        spine = self._trunk.spine
        positions, _ = self._skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
        nearest: Array = np.full(len(poses), np.inf)
        for arm in self._trunk.arms:
            for share in ALONG_ARM:
                point = (1 - share) * positions[:, arm.shoulder] + share * positions[:, arm.elbow]
                for low, high in zip(spine[1:], spine[:-1], strict=True):
                    nearest = np.minimum(nearest, _distance(point, positions[:, low], positions[:, high]))
        depths: Array = np.maximum(1.0 - nearest / self._trunk.radius_m, 0.0)
        return depths


def _distance(points: Array, starts: Array, ends: Array) -> Array:
    """(T,): metres from points (T, 3) to the bones from starts to ends."""
    bones, away = ends - starts, points - starts
    lengths = np.maximum((bones * bones).sum(axis=-1), 1e-12)
    share = np.clip((away * bones).sum(axis=-1) / lengths, 0.0, 1.0)
    distance: Array = np.linalg.norm(away - share[:, None] * bones, axis=-1)
    return distance


def _steps(poses: Array) -> Array:
    """(T - 1, M): angle of each joint from tick to tick, degrees."""
    steps: Array = np.degrees(quaternion.angle_between(poses[1:], poses[:-1]))
    return steps
