"""Arm clearance: an arm that would pass through trunk or head goes around it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import cast

from appliance.dancer import two_bones
from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.slerp import FloatArray
from appliance.dancer.trunk import Arm, Trunk
from appliance.pose import turns
from appliance.pose.skeleton import Skeleton
from appliance.pose.turns import Quaternion, Vector

# Measured on salsa_29 at 10/9, share of the ticks with an upper arm deep in the trunk: 3.5 % -> 0 with the
# hand of salsa_24 on the left upper arm; 26 % -> 0.2 and 6.5 % with one that turns about z once in 5 s and
# once in 1 s; 1.8 % -> 0 in the phrase. The held upper arm gives way by 0.3 degrees on average, by 3 where it
# turns. At once and without a memory of the side arms snap: with the fast turn 25 degrees a tick squared
# (99th percentile), where they have 10 so, and 8.5 untreated. The head: with a left upper arm that turns
# about z once in 5 s, pasted on the default phrase, a forearm was within 7 cm of the skull's middle in
# 13.6 % -> 0.5.
CLEAR = 0.85  # fraction of the trunk's radius: how far out the arm's axis is kept
UPPER_ARM, FOREARM = (0.5, 0.75, 1.0), (0.5, 1.0)  # points along the bones
MEMORY = 0.6  # fraction of the radius: how much the arm's own side counts against the nearest way out
FRONT = 0.1  # fraction of the radius: an arm that points at the spine goes in front of the body
FOLLOW = 0.4  # share of a correction that is made in a tick
MOST_RADIANS = math.radians(4)  # by which a correction changes in a tick
NOTHING_RADIANS = 1e-4
_ROUNDS = 3
_NO_TURN = (0.0, 0.0, 0.0)

_Bone = tuple[Vector, Vector, float]  # start, direction with length, square of it
_Around = tuple[list[_Bone], Vector]  # the spine's bones, and where the front of the body is


class ArmClearance:
    """Turns upper arms and forearms so that their axes stay out of trunk and head; once a tick.

    The deepest of a bone's points is pushed out the shortest way across the bone, which turns with it. The
    correction follows with a limited speed and remembers its side, so an arm that a hand leads through the
    body bends around it instead of jumping to the other side.
    """

    SNAPSHOT = ("_ways", "_turns")

    def __init__(self, skeleton: Skeleton) -> None:
        self._trunk = Trunk.of(skeleton)
        bones = 2 * len(self._trunk.arms) if self._trunk else 0
        self._ways: list[Vector | None] = [None] * bones  # out of the trunk, of length 1
        self._turns: list[Vector] = [_NO_TURN] * bones  # corrections in force: axis times radians

    def clear(self, pose: FloatArray, figure: Figure) -> bool:
        """Turn the arms in a pose (J, 4); whether anything was turned: `figure` shows the pose as it was."""
        if self._trunk is None:
            return False
        places = [two_bones.vector(place) for place in figure.positions.tolist()]
        trunk = [_bone(places[low], places[high]) for high, low in pairwise(self._trunk.spine)]
        head, turned = self._trunk.head, two_bones.quaternion(figure.world[self._trunk.head].tolist())
        skull = two_bones.add(places[head], two_bones.rotate(turned, self._trunk.skull))
        trunk.append(_bone(places[head], skull))
        left, right = (places[arm.shoulder] for arm in self._trunk.arms)
        up = turns.minus(places[self._trunk.spine[0]], places[self._trunk.spine[-1]])
        ahead = turns.cross(turns.minus(left, right), up)
        front = two_bones.scale(ahead, 1 / max(two_bones.norm(ahead), 1e-9))
        around = trunk, front
        are_turned = [self._clear(*one, pose, figure, places, around) for one in enumerate(self._trunk.arms)]
        return any(are_turned)

    def begin_anew(self) -> None:
        """Forget the ticks before: no arm is turned."""
        self._ways = [None] * len(self._ways)
        self._turns = [_NO_TURN] * len(self._turns)

    def _clear(
        self,
        number: int,
        arm: Arm,
        pose: FloatArray,
        figure: Figure,
        places: list[Vector],
        around: _Around,
    ) -> bool:
        shoulder, elbow, wrist = places[arm.shoulder], places[arm.elbow], places[arm.wrist]
        turn = self._correction(2 * number, shoulder, elbow, UPPER_ARM, around)
        if turn is not None:
            bone, below = turns.minus(elbow, shoulder), turns.minus(wrist, elbow)
            elbow = two_bones.add(shoulder, two_bones.rotate(turn, bone))
            wrist = two_bones.add(elbow, two_bones.rotate(turn, below))
        bend = self._correction(2 * number + 1, elbow, wrist, FOREARM, around)
        if turn is None and bend is None:
            return False
        above, upper, lower = (
            two_bones.quaternion(figure.world[joint].tolist())
            for joint in (arm.above, arm.shoulder, arm.elbow)
        )
        if turn is not None:
            upper, lower = turns.multiplied(turn, upper), turns.multiplied(turn, lower)
            pose[arm.shoulder] = turns.multiplied(turns.inverse(above), upper)
        if bend is not None:
            lower = turns.multiplied(bend, lower)
            pose[arm.elbow] = turns.multiplied(turns.inverse(upper), lower)
        return True

    def _correction(
        self, bone: int, pivot: Vector, end: Vector, shares: tuple[float, ...], around: _Around
    ) -> Quaternion | None:
        """The turn of a bone about its pivot in this tick, in the world; None: none."""
        wanted = self._way_out(bone, pivot, end, shares, around)
        if wanted is _NO_TURN and self._turns[bone] is _NO_TURN:
            return None
        step = two_bones.scale(turns.minus(wanted, self._turns[bone]), FOLLOW)
        length = two_bones.norm(step)
        if length > MOST_RADIANS:
            step = two_bones.scale(step, MOST_RADIANS / length)
        turn = two_bones.add(self._turns[bone], step)
        radians = two_bones.norm(turn)
        if radians < NOTHING_RADIANS:
            self._turns[bone] = _NO_TURN
            return None
        self._turns[bone] = turn
        sine = math.sin(radians / 2) / radians
        return math.cos(radians / 2), turn[0] * sine, turn[1] * sine, turn[2] * sine

    def _way_out(
        self, bone: int, pivot: Vector, end: Vector, shares: tuple[float, ...], around: _Around
    ) -> Vector:
        """The turn, axis times radians, that would bring the bone out of the trunk at once."""
        radius_m, before = cast(Trunk, self._trunk).radius_m, self._ways[bone]
        trunk, front = around
        turn: Quaternion = (1.0, 0.0, 0.0, 0.0)
        along, self._ways[bone] = turns.minus(end, pivot), None
        for _ in range(_ROUNDS):  # the way out is straight, and the bone turns: once is not enough
            points = [two_bones.add(pivot, two_bones.scale(along, share)) for share in shares]
            distance, away, deepest = min((*_from_trunk(point, trunk), point) for point in points)
            missing = CLEAR * radius_m - distance
            if missing <= 0.0:
                if self._ways[bone] is None:
                    return _NO_TURN
                break
            away = two_bones.add(away, two_bones.scale(front, FRONT * radius_m))
            if before is not None:
                away = two_bones.add(away, two_bones.scale(before, MEMORY * radius_m))
            across = turns.dot(away, along) / max(turns.dot(along, along), 1e-9)
            away = turns.minus(away, two_bones.scale(along, across))
            before = self._ways[bone] = two_bones.scale(away, 1 / max(two_bones.norm(away), 1e-9))
            lever = turns.minus(deepest, pivot)
            more = two_bones.between(lever, two_bones.add(lever, two_bones.scale(before, missing)))
            turn, along = turns.multiplied(more, turn), two_bones.rotate(more, along)
        w, *axis = turn
        sine = math.sqrt(max(0.0, 1.0 - w * w))
        return two_bones.scale(two_bones.vector(axis), 2 * math.atan2(sine, w) / sine if sine > 1e-9 else 0.0)


def _from_trunk(point: Vector, trunk: list[_Bone]) -> tuple[float, Vector]:
    """How far a point is from the spine, metres, and the vector from there to it.

    Ten points a tick: written out, for with the functions of two_bones it takes three times as long.
    """
    (px, py, pz), nearest, away = point, math.inf, (0.0, 0.0, 0.0)
    for (sx, sy, sz), (bx, by, bz), square in trunk:
        x, y, z = px - sx, py - sy, pz - sz
        share = min(1.0, max(0.0, (x * bx + y * by + z * bz) / square))
        x, y, z = x - share * bx, y - share * by, z - share * bz
        distance = x * x + y * y + z * z
        if distance < nearest:
            nearest, away = distance, (x, y, z)
    return math.sqrt(nearest), away


def _bone(start: Vector, end: Vector) -> _Bone:
    along = turns.minus(end, start)
    return start, along, max(turns.dot(along, along), 1e-12)
