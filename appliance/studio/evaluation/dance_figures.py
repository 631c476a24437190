"""Figures of a dance: energy, roughness and steps of its motion; arms in trunk and arm, sliding feet."""

from __future__ import annotations

from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from appliance.dancer.forward_kinematics import soles_of
from appliance.dancer.grounding import Floor, Grounding, GroundingError, sole_positions, survey
from appliance.dancer.trunk import Trunk
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.standing import measure_standing

ROUGHNESS_PERCENTILE = DEPTH_PERCENTILE = 99.0
ALONG_BONE = np.linspace(0.0, 1.0, 9)
DEEP = 0.3  # fraction of that radius below the surface: 3.5 cm
TOUCHING_M = 0.03  # between the axes of two arms
ALONG_ARM = (0.5, 0.75, 1.0)  # fraction of the upper arm: its inner half begins in the trunk


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


def jerk(poses: Array) -> float:
    """Mean second difference of the joints' angular velocities, poses (T, M, 4), degrees a tick cubed."""
    turns = quaternion.multiply(poses[1:], quaternion.inverse(poses[:-1]))
    axes, angles = quaternion.to_axis_angle(turns)
    velocities = axes * np.degrees(angles)[..., None]
    return float(np.linalg.norm(np.diff(velocities, n=2, axis=0), axis=-1).mean())


def roughness(poses: Array) -> float:
    """99th percentile of the angular acceleration over ticks and joints, degrees a tick squared.

    A joint's angular velocity is the axis of its step times the angle, in the parent's frame.
    """
    turns = quaternion.multiply(poses[1:], quaternion.inverse(poses[:-1]))
    axes, angles = quaternion.to_axis_angle(turns)
    velocities = axes * np.degrees(angles)[..., None]
    accelerations = np.linalg.norm(np.diff(velocities, axis=0), axis=-1)
    return float(np.percentile(accelerations, ROUGHNESS_PERCENTILE))


class ArmFigures(NamedTuple):
    """arm_in_trunk: share of poses in which an upper arm is deep in the trunk. arm_depth_cm: how far its axis
    is below the surface in the deepest of a hundred poses. arms_touch: share of poses in which upper arm or
    forearm are nearer than 3 cm to the other arm's.
    """

    arm_in_trunk: float = float("nan")
    arm_depth_cm: float = float("nan")
    arms_touch: float = float("nan")


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

    def arms(self, poses: Array) -> ArmFigures:
        """Where the arms are in poses (T, J, 4)."""
        if self._trunk is None:
            return ArmFigures()
        positions, _ = self._skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
        depths = _depths(positions, self._trunk)
        return ArmFigures(
            float((depths > DEEP).mean()),
            100 * self._trunk.radius_m * float(np.percentile(depths, DEPTH_PERCENTILE)),
            float((_between_arms(positions, self._trunk) < TOUCHING_M).mean()),
        )

    def foot_skate(self, poses: Array, roots: Array) -> float:
        """Sliding speed of the supporting foot, m/s, in grounded poses (T, J, 4) with roots (T, 3)."""
        if self._floor is None or len(poses) < 2:
            return float("nan")
        lifts = self._floor.lifts[: len(poses)]
        return measure_standing(self._skeleton, poses, roots, self._floor, lifts).slide_cm_s / 100

    def soles(self, poses: Array, roots: Array) -> tuple[list[Array], list[Array]]:
        """For each foot its points (T, S, 3), metres, and their heights (T, S) above where they are planted.

        None without named feet. poses (T, J, 4) with roots (T, 3).
        """
        if self._floor is None:
            return [], []
        points = sole_positions(self._skeleton, poses, roots)
        above = points[..., 1] - self._floor.rest_heights
        ends = np.cumsum([len(foot) for foot in soles_of(self._skeleton)])[:-1]
        return np.split(points, ends, axis=1), np.split(above, ends, axis=1)

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


def _depths(positions: Array, trunk: Trunk) -> Array:
    """(T,): how far the deepest upper arm is below the trunk's surface, in its radii; 0 outside."""
    nearest: Array = np.full(len(positions), np.inf)
    for arm in trunk.arms:
        for share in ALONG_ARM:
            point = (1 - share) * positions[:, arm.shoulder] + share * positions[:, arm.elbow]
            for low, high in pairwise(trunk.spine[::-1]):
                nearest = np.minimum(nearest, _distance(point, positions[:, low], positions[:, high]))
    depths: Array = np.maximum(1.0 - nearest / trunk.radius_m, 0.0)
    return depths


def _between_arms(positions: Array, trunk: Trunk) -> Array:
    """(T,): metres between the axes of upper arm and forearm of one side and those of the other."""
    left, right = (pairwise((arm.shoulder, arm.elbow, arm.wrist)) for arm in trunk.arms)
    nearest: Array = np.full(len(positions), np.inf)
    for bones in product(left, right):
        for (start, end), (first, last) in (bones, bones[::-1]):
            for share in ALONG_BONE:
                point = (1 - share) * positions[:, first] + share * positions[:, last]
                nearest = np.minimum(nearest, _distance(point, positions[:, start], positions[:, end]))
    return nearest


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
