"""Grounding: what the puppet danced becomes a body: feet on the floor, no sliding, arms out of the trunk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appliance.dancer.arm_clearance import ArmClearance
from appliance.dancer.foot_lock import JUMP_M, FootLock
from appliance.dancer.forward_kinematics import Figure, soles_of
from appliance.dancer.slerp import FloatArray
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

# Capture leaves planted feet some centimetres off the floor: up to FLOOR_NOISE_M they are set down on it.
# From JUMP_M on the phrase really jumps, and keeps its height; in between, one blends into the other.
FLOOR_NOISE_M = 0.03
PLANTED_PERCENTILE = 5.0  # percentile of a point's heights over the phrase: its height while planted
MOST_ABOVE_OTHER_FOOT_M = 0.03  # so that a foot that is never planted in a phrase does not count as planted
SUPPORT_M = 0.02  # points of the feet this close to the lowest one share its support
SWINGING_M_S = 1.0  # a point at this speed counts half: it lands or lifts and does not carry
# The share of a correction that is made at once; the rest follows in later ticks. Measured on three takes at
# ten coding iterations with a held joint (untreated: 92 cm/s of slide): all at once leaves 11 cm/s, but the
# hip shakes with 28 mm per tick^2 (99th percentile); 0.85 leaves 13 cm/s and 26 mm; 0.7 leaves 18 and 22.
FOLLOW = 0.85
LEAK_S = 6.0  # time constant of the root's return to its path
_AT_ONCE = 512  # poses whose soles are looked for: all of a long phrase take tens of MB
FAR_M = 1.0  # this far from its path the root returns twice as fast


class GroundingError(ValueError):
    """A skeleton without named feet."""


@dataclass(frozen=True)
class Floor:
    """Facts about a phrase that grounding uses.

    rest_heights (S,): height in metres of each point of the soles above the floor when it is planted;
    lifts (N,): how far the phrase's lowest foot is above the floor in a jump, 0 while it stands.
    """

    rest_heights: FloatArray
    lifts: FloatArray


def survey(phrase: Recording) -> Floor:
    """Estimate the floor from a phrase. Raises GroundingError for a skeleton without named feet."""
    heights = sole_positions(phrase.skeleton, phrase.poses, phrase.roots)[..., 1]
    rest = np.percentile(heights, PLANTED_PERCENTILE, axis=0)
    feet = soles_of(phrase.skeleton)
    if len({len(points) for points in feet}) == 1:
        same_points = rest.reshape(len(feet), -1)  # ankle of each foot, toe of each foot, ...
        rest = np.minimum(same_points, same_points.min(axis=0) + MOST_ABOVE_OTHER_FOOT_M).ravel()
    lifts = lift(np.min(heights - rest, axis=-1))
    return Floor(rest.astype(np.float32), lifts.astype(np.float32))


def lift(clearance: Array) -> Array:
    """The part of a height above the floor (metres) that is a jump: 0 to FLOOR_NOISE_M, all from JUMP_M."""
    share = np.clip((clearance - FLOOR_NOISE_M) / (JUMP_M - FLOOR_NOISE_M), 0.0, 1.0)
    jumped: Array = clearance * ease(share)
    return jumped


class Grounding:
    """Stands a pose on the floor and pins the feet that carry it; once per tick.

    Vertically the lowest point of the soles comes to the phrase's lift above the floor. Horizontally the root
    leaves its path by as much as the supporting points would slide; support passes from foot to foot with
    their heights and speeds, so nothing pops; the offset decays in about LEAK_S. If a puppet's legs stand
    still while the phrase's root travels, the feet finally slide after it: the stage has an edge. One root
    cannot hold two feet that the puppet moves against each other: the legs make up for the rest (FootLock).
    """

    SNAPSHOT = (
        *("figure", "root", "pose", "_foot_lock", "_arms", "_rest", "_offset_x", "_offset_z", "_step_x"),
        *("_step_z", "_height", "_before"),
    )

    def __init__(self, skeleton: Skeleton, floor: Floor | None, tick_s: float = 0.02) -> None:
        """floor None: figures stay where the phrase has them."""
        self.figure = Figure(skeleton)
        self.root = np.zeros(3, dtype=np.float32)
        self.pose = np.zeros((len(skeleton), 4), dtype=np.float32)
        self._foot_lock = FootLock(skeleton, tick_s)
        self._arms = ArmClearance(skeleton)
        self._rest = None if floor is None else floor.rest_heights.tolist()
        self._leak = tick_s / LEAK_S
        self._swinging = (SWINGING_M_S * tick_s) ** 2
        self._offset_x = self._offset_z = 0.0  # offset of the root from its path
        self._step_x = self._step_z = 0.0  # that offset in the last tick
        self._led = 0.0, 0.0  # how far the root is led in the next tick
        self._hips = 0.0, 0.0, 0.0  # where a hand draws the root to, x and z in metres, and its weight
        self._height: float | None = None
        self._before: list[list[float]] | None = None
        self._shift = np.zeros(3, dtype=np.float32)

    @property
    def strayed(self) -> tuple[float, float]:
        """Offset of the root from its path, metres along x and z; set it before the first pose."""
        return self._offset_x, self._offset_z

    @strayed.setter
    def strayed(self, metres: tuple[float, float]) -> None:
        self._offset_x, self._offset_z = metres

    @property
    def shift(self) -> FloatArray:
        """(3,): from the phrase's root to where grounding stood it in the last tick, metres."""
        return np.array((self._offset_x, self._height or 0.0, self._offset_z), dtype=np.float32)

    def begin_anew(self) -> None:
        """Forget the ticks before: the next pose starts on its path."""
        self._offset_x = self._offset_z = self._step_x = self._step_z = 0.0
        self._height = self._before = None
        self._foot_lock.begin_anew()
        self._arms.begin_anew()

    def draw_hips(self, x: float, z: float, weight: float) -> None:
        """From the next pose on the root is placed at x, z (metres), weighted by 0..1.

        The path and its offset go on below it, so that the root returns there as the weight fades. The feet
        stay where they carry the figure, as far as the legs reach (FootLock), and come along when they lift.
        """
        self._hips = x, z, weight

    def lead(self, x: float, z: float) -> None:
        """With the next pose the root leaves its path by so much more, metres.

        A foot that carries the figure stays where it is, as far as its leg reaches (FootLock), and comes
        along when it lifts. The way back to the path is that of every offset.
        """
        self._led = x, z

    def ground_pose(
        self,
        pose: FloatArray,
        root: FloatArray,
        lift_m: float,
        rest_heights: FloatArray | None = None,
        held: FloatArray | None = None,
    ) -> Figure:
        """Ground a pose (J, 4) with the phrase's root at (3,) metres and its feet lifted by lift_m.

        rest_heights (S,): the floor of the phrase that plays now; None: unchanged. held (J,): weights 0..1 of
        the hands, whose legs are left as they are; None: all legs are.
        Its positions and world rotations, `root` and `pose` hold until the next call.
        """
        self.figure.set_pose(pose, root)
        self.root[:], self.pose[:] = root, pose
        if self._arms.clear(self.pose, self.figure):
            self.figure.set_pose(self.pose, root)
        if rest_heights is not None and self._rest is not None:
            self._rest = rest_heights.tolist()
        if self._rest is not None:
            self._stand(self._rest, lift_m, held)
        else:
            self._leave_path(*self._led)
            if self._hips[2] or self._offset_x or self._offset_z:
                self._move(0.0)
        return self.figure

    def _stand(self, rest: list[float], lift_m: float, held: FloatArray | None) -> None:
        """Move the figure onto the floor, and turn its legs."""
        points = self.figure.soles.tolist()
        clearances = [point[1] - rest for point, rest in zip(points, rest, strict=True)]
        lowest = min(clearances)
        if self._before is not None:
            self._pin(points, self._before, clearances, lowest, lift_m)
            self._leave_path(self._step_x + self._led[0], self._step_z + self._led[1])
        self._before = points
        wanted = lift_m - lowest
        self._height = wanted if self._height is None else self._height + FOLLOW * (wanted - self._height)
        self._move(self._height)
        above_floor = [clearance + self._height for clearance in clearances]
        self._foot_lock.lock(self.pose, self.figure, above_floor, lift_m, held)

    def _move(self, height: float) -> None:
        """Move figure and root from the phrase's root to their offset, this high, and to the hand."""
        x, z, weight = self._hips
        drawn_x = weight * (x - float(self.root[0]) - self._offset_x)
        drawn_z = weight * (z - float(self.root[2]) - self._offset_z)
        self._shift[:] = self._offset_x + drawn_x, height, self._offset_z + drawn_z
        self.figure.move(self._shift)
        np.add(self.root, self._shift, out=self.root)

    def _pin(
        self,
        points: list[list[float]],
        before: list[list[float]],
        clearances: list[float],
        lowest: float,
        lift_m: float,
    ) -> None:
        """Move the root's offset against the motion of the points that carry the figure."""
        total = slide_x = slide_z = 0.0
        for point, earlier, clearance in zip(points, before, clearances, strict=True):
            x, z = point[0] - earlier[0], point[2] - earlier[2]
            speed = (x + self._step_x) ** 2 + (z + self._step_z) ** 2
            support = max(0.0, 1.0 - (clearance - lowest) / SUPPORT_M) ** 2 / (1.0 + speed / self._swinging)
            total += support
            slide_x += support * x
            slide_z += support * z
        standing = max(0.0, 1.0 - lift_m / JUMP_M) / total  # the lowest point gives some support at any speed
        self._step_x += FOLLOW * (-standing * slide_x - self._step_x)
        self._step_z += FOLLOW * (-standing * slide_z - self._step_z)

    def _leave_path(self, x: float, z: float) -> None:
        """Change the root's offset by so much, and let the whole of it decay."""
        far = (self._offset_x**2 + self._offset_z**2) / FAR_M**2
        kept = max(0.0, 1.0 - self._leak * (1.0 + far))  # below 0 an offset of 17 m would grow for ever
        self._offset_x = (self._offset_x + x) * kept
        self._offset_z = (self._offset_z + z) * kept


def sole_positions(skeleton: Skeleton, poses: Array, roots: Array) -> Array:
    """World positions (N, S, 3) in metres of the points of the soles. Raises GroundingError without feet."""
    points = [point for foot in soles_of(skeleton) for point in foot]
    if not points:
        raise GroundingError(
            "No joint of this skeleton is named foot or ankle, so the figure cannot be set on the floor. "
            "Set grounded: false, or rename the joints."
        )
    found = np.empty((len(poses), len(points), 3), dtype=poses.dtype)
    for first in range(0, len(poses), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        positions, world = skeleton.forward_kinematics(poses[some], roots[some])
        for column, point in enumerate(points):
            if point < len(skeleton):
                found[some, column] = positions[:, point]
            else:
                joint, offset = skeleton.ends[point - len(skeleton)]
                turned = quaternion.rotate(world[:, joint], np.asarray(offset, dtype=poses.dtype))
                found[some, column] = positions[:, joint] + turned
    return found
