"""Foot lock: a foot that carries the figure stays where it is, and its leg makes up for it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from appliance.dancer import two_bones
from appliance.dancer.forward_kinematics import Figure, soles_of
from appliance.dancer.slerp import FloatArray
from appliance.pose import turns
from appliance.pose.skeleton import Skeleton

# Measured at ten coding and nine interaction iterations (salsa_29 with hands of salsa_24), mean slide of the
# supporting foot with a hand on the left upper arm, the right one, the head: 0.22, 0.19, 0.19 m/s without the
# lock, 0.07, 0.05, 0.05 with it; without a hand 0.08 and 0.02. The legs turn by 3 degrees for it, and are as
# smooth as before (99th percentile of the angular acceleration: within 5 %).
LOW_M = 0.03  # a foot this far above the other, or above the floor, carries nothing
SUPPORT_M = 0.02  # points of a foot this close to its lowest one share its support
SWINGING_M_S = 1.0  # a foot at this speed counts half: it swings
AIR_S = 0.08  # time constant of a lifted foot's return to its leg's own path
FAR_M = 0.2  # this far from its path a planted foot returns with the time constant FAR_S
FAR_S = 0.6
JUMP_M = 0.08  # from this height of a jump on nothing is locked
NOTHING_M = 1e-4
BONES_ALIKE = 3.0  # if thigh or shin is longer than this times the other, it is not a leg


@dataclass
class _Leg:
    """thigh, shin, foot: joints; hip: the joint above; below: foot and what hangs on it; rows: its points
    among the soles.
    """

    SNAPSHOT = ("x", "z", "step")

    hip: int
    thigh: int
    shin: int
    foot: int
    below: list[int]
    rows: range
    x: float = 0.0  # offset of the foot from its path, metres
    z: float = 0.0
    step: list[float] = field(default_factory=lambda: [0.0, 0.0])  # that offset in the last tick


class FootLock:
    """Offsets each foot against its slide and turns thigh, shin and foot so that the leg reaches there.

    The same law as the root's in grounding, for each foot by itself: support grows with a foot's nearness to
    the floor and falls with its speed, so nothing pops. The offset returns quickly in the air and, the
    farther the faster, on the floor. Feet keep their orientation. Legs that a hand holds are left alone.
    """

    SNAPSHOT = ("_before", "_legs")

    def __init__(self, skeleton: Skeleton, tick_s: float = 0.02) -> None:
        self._tick_s = tick_s
        self._swinging = (SWINGING_M_S * tick_s) ** 2
        self._legs: list[_Leg] = []
        self._before: list[list[float]] | None = None
        first = 0
        for points in soles_of(skeleton):
            rows = range(first, first + len(points))
            first += len(points)
            foot = points[0]
            shin = skeleton.parents[foot]
            thigh = skeleton.parents[shin] if shin > 0 else -1
            hip = skeleton.parents[thigh] if thigh > 0 else -1
            if hip < 0:
                continue
            long, short = (math.hypot(*skeleton.offsets[joint].tolist()) for joint in (shin, foot))
            if max(long, short) < BONES_ALIKE * min(long, short):
                self._legs.append(_Leg(hip, thigh, shin, foot, skeleton.descendants(foot), rows))

    def lock(
        self,
        pose: FloatArray,
        figure: Figure,
        clearances: list[float],
        lift_m: float,
        held: FloatArray | None,
    ) -> None:
        """Turn the legs in a pose (J, 4) and in its figure.

        figure: the pose, grounded. clearances (S,): of its soles' points above their place on the floor,
        metres; lift_m: of a jump. held (J,): weights 0..1 of the hands; None: no foot is locked.
        """
        points = figure.soles.tolist()
        for leg in self._legs:
            if self._before is not None:
                share = 0.0
                if held is not None:
                    share = 1.0 - max(float(held[leg.thigh]), float(held[leg.shin]), float(held[leg.foot]))
                share *= max(0.0, 1.0 - lift_m / JUMP_M)
                self._offset(leg, points, self._before, clearances, lift_m, share)
            if leg.x or leg.z:
                self._reach(leg, pose, figure, points[leg.rows[-1]])
        self._before = points

    def begin_anew(self) -> None:
        """Forget the ticks before: feet stand where the next pose has them."""
        self._before = None
        for leg in self._legs:
            leg.x, leg.z, leg.step = 0.0, 0.0, [0.0, 0.0]

    def _offset(
        self,
        leg: _Leg,
        points: list[list[float]],
        before: list[list[float]],
        clearances: list[float],
        lift_m: float,
        share: float,
    ) -> None:
        """Move a foot's offset against the motion of its lowest points."""
        lowest = min(clearances[row] for row in leg.rows)
        total = x = z = 0.0
        for row in leg.rows:
            weight = max(0.0, 1.0 - (clearances[row] - lowest) / SUPPORT_M) ** 2
            total += weight
            x += weight * (points[row][0] - before[row][0])
            z += weight * (points[row][2] - before[row][2])
        x, z = x / total, z / total
        speed = (x + leg.step[0]) ** 2 + (z + leg.step[1]) ** 2
        near = min(1.0, max(0.0, 1.0 - (lowest - lift_m) / LOW_M))
        support = share * near * near / (1.0 + speed / self._swinging)
        leg.step[:] = -support * x, -support * z
        far = (leg.x * leg.x + leg.z * leg.z) / FAR_M**2
        returning = self._tick_s * ((1.0 - support) / AIR_S + support * far / FAR_S)
        kept = max(0.0, 1.0 - returning)
        leg.x, leg.z = (leg.x + leg.step[0]) * kept, (leg.z + leg.step[1]) * kept
        if abs(leg.x) + abs(leg.z) < NOTHING_M and not support:
            leg.x = leg.z = 0.0

    def _reach(self, leg: _Leg, pose: FloatArray, figure: Figure, toe: list[float]) -> None:
        """Turn thigh and shin so that the foot comes to its offset, and the foot back; shorten the offset to
        the leg's reach.
        """
        hip, knee, ankle = (
            two_bones.vector(figure.positions[joint].tolist()) for joint in (leg.thigh, leg.shin, leg.foot)
        )
        target = ankle[0] + leg.x, ankle[1], ankle[2] + leg.z
        ahead = turns.minus(two_bones.vector(toe), ankle)
        bent, reached = two_bones.bend(hip, knee, ankle, target, ahead)
        leg.x, leg.z = reached[0] - ankle[0], reached[2] - ankle[2]
        above, thigh, shin, foot = (
            two_bones.quaternion(figure.world[joint].tolist())
            for joint in (leg.hip, leg.thigh, leg.shin, leg.foot)
        )
        turn = two_bones.between(turns.minus(knee, hip), turns.minus(bent, hip))
        thigh = turns.multiplied(turn, thigh)
        turn = two_bones.between(turns.minus(ankle, knee), turns.minus(reached, bent))
        shin = turns.multiplied(turn, shin)
        pose[leg.thigh] = turns.multiplied(turns.inverse(above), thigh)
        pose[leg.shin] = turns.multiplied(turns.inverse(thigh), shin)
        pose[leg.foot] = turns.multiplied(turns.inverse(shin), foot)
        figure.world[leg.thigh], figure.world[leg.shin] = thigh, shin
        figure.positions[leg.shin] = bent
        shift = turns.minus(reached, ankle)
        figure.positions[leg.below] += shift  # the foot keeps its orientation
        figure.soles[leg.rows.start : leg.rows.stop] += shift
