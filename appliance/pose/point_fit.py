"""Turns of a figure's bones from points tracked on a person, frame by frame, without knowing what follows."""

from __future__ import annotations

import math
from collections.abc import Mapping

from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import humanoid_rest
from appliance.pose.turns import (
    Quaternion,
    Vector,
    about,
    dot,
    halfway,
    middle,
    minus,
    multiplied,
    rotated,
    swing,
    twist,
    unit,
)

Points = Mapping[str, Vector]
SIDES = ("left", "right")
TRUNK = ("left shoulder", "right shoulder", "left hip", "right hip")  # without these there is no figure
_JOINTS = {  # point to the part of a body (roles.ROLES) whose joint is there
    "shoulder": "upper arm", "elbow": "forearm", "wrist": "hand",
    "hip": "thigh", "knee": "shin", "ankle": "foot", "toe": "toe",
}  # fmt: skip
_CHAINS = (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "toe"))
_T_POSE: dict[str, Vector] = {  # for joints that a figure lacks: metres from the hips; the left side
    "shoulder": (0.19, 0.50, 0.0), "elbow": (0.47, 0.50, 0.0), "wrist": (0.73, 0.50, 0.0),
    "hip": (0.09, -0.04, 0.0), "knee": (0.09, -0.45, 0.0), "ankle": (0.09, -0.87, 0.0),
    "toe": (0.09, -0.92, 0.14),
}  # fmt: skip
_FRONT: Vector = (0.0, 0.0, 1.0)
_BACK: Vector = (0.0, 0.0, -1.0)
_LEFT: Vector = (1.0, 0.0, 0.0)
# Between these angles an elbow or a knee begins to say how the limb above is turned about itself.
_STRAIGHT, _BENT = math.radians(8.0), math.radians(35.0)
_LEAST_BEND = math.radians(5.0)  # an elbow bent so far in the T-pose shows the way in which it bends
_MOST_TWIST = 1.5 * math.pi
_LIMBS = (
    ("UpperArm", "LowerArm", "shoulder", "elbow", "wrist"),
    ("UpperLeg", "LowerLeg", "hip", "knee", "ankle"),
)
_LENGTHS = tuple(
    (f"{side} {start}", f"{side} {end}")
    for side in SIDES
    for start, end in (("hip", "knee"), ("knee", "ankle"), ("hip", "shoulder"), ("shoulder", "elbow"))
)


class PointFit:
    """Points are where joints are, in axes with +Y up and +Z to the front: any unit, any place.

    Hips and chest turn as two lines of theirs do, limbs point where their points are. An elbow or a knee that
    is bent also says how the limb above is turned about itself; a straight one leaves it as the trunk has it.
    Names of bones are Unity's. Rest directions are those of the figure's T-pose.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._rest = rest_points(skeleton)
        self._hinges = {side: (_elbow_hinge(self._rest, side), _BACK) for side in SIDES}
        self._twists: dict[str, float] = {}

    def begin(self) -> None:
        """Forget the frames before: the next ones are of another dancer."""
        self._twists.clear()

    def turns(self, points: Points) -> dict[str, Quaternion]:
        """The bones' turns in the room from a T-pose; those that the points leave open are left out.

        Raises ValueError where TRUNK is not whole, or has no extent.
        """
        if any(part not in points for part in TRUNK):
            raise ValueError("both hips and both shoulders have to be seen")
        found: dict[str, Quaternion] = {}
        rest, hips, shoulders = self._rest, _middle(points, "hip"), _middle(points, "shoulder")
        start = points.get("chest", hips)
        rest_start = rest["chest"] if "chest" in points else _middle(rest, "hip")
        above = points.get("chest", shoulders)
        rest_above = rest["chest"] if "chest" in points else _middle(rest, "shoulder")
        hips_turn = _frame(
            _across(rest, "hip"),
            minus(rest_above, _middle(rest, "hip")),
            _across(points, "hip"),
            minus(above, hips),
        )
        chest = _frame(
            minus(_middle(rest, "shoulder"), rest_start),
            _across(rest, "shoulder"),
            minus(shoulders, start),
            _across(points, "shoulder"),
        )
        if hips_turn is None or chest is None:
            raise ValueError("hips and shoulders are in one place")
        found["Hips"], found["Spine"] = hips_turn, halfway(hips_turn, chest)
        found["Chest"] = found["UpperChest"] = chest
        head = self._head(points, chest)
        if head is not None:
            found["Head"], found["Neck"] = head, halfway(chest, head)
        for side in SIDES:
            found[f"{side.capitalize()}Shoulder"] = chest
            self._limbs(points, side, found)
        return found

    def root(self, points: Points, hips_turn: Quaternion, scale: float) -> Vector:
        """Where the hips' joint is, in metres, of a figure that is `scale` times as large as the points."""
        place, reach = _middle(points, "hip"), minus(self._rest["hips"], _middle(self._rest, "hip"))
        x, y, z = rotated(hips_turn, reach)
        return scale * place[0] + x, scale * place[1] + y, scale * place[2] + z

    def height(self, turns: Mapping[str, Quaternion]) -> float | None:
        """How high the hips' joint is over the lower ankle, metres; None: no leg is known."""
        found = []
        for side in SIDES:
            names = [f"{side.capitalize()}{bone}" for bone in ("UpperLeg", "LowerLeg")]
            if any(name not in turns for name in names):
                continue
            hip, knee, ankle = (self._rest[f"{side} {part}"] for part in ("hip", "knee", "ankle"))
            thigh = rotated(turns["Hips"], minus(hip, self._rest["hips"]))
            shin = rotated(turns[names[1]], minus(ankle, knee))
            found.append(-thigh[1] - rotated(turns[names[0]], minus(knee, hip))[1] - shin[1])
        return max(found, default=None)

    def scale(self, points: Points) -> float | None:
        """How many times as large as the points the figure is; None: no bone is seen."""
        seen = [(a, b) for a, b in _LENGTHS if a in points and b in points]
        long = sum(math.dist(points[a], points[b]) for a, b in seen)
        return sum(math.dist(self._rest[a], self._rest[b]) for a, b in seen) / long if long > 1e-6 else None

    def _head(self, points: Points, chest: Quaternion) -> Quaternion | None:
        face = [points[part] for part in ("nose", "left eye", "right eye") if part in points]
        sides = next(
            (one for one in ("ear", "eye") if f"left {one}" in points and f"right {one}" in points), ""
        )
        if sides and face:
            front = face[0] if len(face) < 3 else middle(face[0], middle(face[1], face[2]))
            return _frame(_LEFT, _FRONT, _across(points, sides), minus(front, _middle(points, sides)))
        if "head" not in points:
            return None
        up, rest_up = unit(minus(points["head"], _middle(points, "shoulder"))), (0.0, 1.0, 0.0)
        return None if up is None else multiplied(swing(rotated(chest, rest_up), up), chest)

    def _limbs(self, points: Points, side: str, found: dict[str, Quaternion]) -> None:
        name = side.capitalize()
        for (upper, lower, *joints), hinge, above in zip(
            _LIMBS, self._hinges[side], (found["Chest"], found["Hips"]), strict=True
        ):
            start, bend, end = (f"{side} {joint}" for joint in joints)
            first, second = self._way(points, start, bend), self._way(points, bend, end)
            if first is None:
                continue
            turn = multiplied(swing(rotated(above, first[0]), first[1]), above)
            if second is not None:
                radians = self._twist(f"{name}{upper}", first[1], rotated(turn, hinge), second[1])
                turn = multiplied(about(first[1], radians), turn)
                found[f"{name}{lower}"] = multiplied(swing(rotated(turn, second[0]), second[1]), turn)
            found[f"{name}{upper}"] = turn
        self._hand(points, side, found)
        foot, shin = self._way(points, f"{side} ankle", f"{side} toe"), found.get(f"{name}LowerLeg")
        if foot is not None and shin is not None:
            found[f"{name}Foot"] = multiplied(swing(rotated(shin, foot[0]), foot[1]), shin)

    def _hand(self, points: Points, side: str, found: dict[str, Quaternion]) -> None:
        """The hand points as the forearm does in the T-pose, its thumb to the front."""
        wrist = points.get(f"{side} wrist")
        fingers = [points[one] for part in ("index", "little") if (one := f"{side} {part}") in points]
        tip = points.get(f"{side} hand", middle(*fingers) if len(fingers) == 2 else None)
        forearm = unit(minus(self._rest[f"{side} wrist"], self._rest[f"{side} elbow"]))
        if wrist is None or tip is None or forearm is None:
            return
        if len(fingers) == 2:
            thumb_side = minus(fingers[0], fingers[1])
        elif f"{side} thumb" in points:
            thumb_side = minus(points[f"{side} thumb"], wrist)
        else:
            return
        hand = _frame(forearm, _FRONT, minus(tip, wrist), thumb_side)
        if hand is not None:
            found[f"{side.capitalize()}Hand"] = hand

    def _way(self, points: Points, start: str, end: str) -> tuple[Vector, Vector] | None:
        """Where a bone points at rest, and now; None: it is not seen."""
        if start not in points or end not in points:
            return None
        rest, now = unit(minus(self._rest[end], self._rest[start])), unit(minus(points[end], points[start]))
        return None if rest is None or now is None else (rest, now)

    def _twist(self, bone: str, along: Vector, hinge: Vector, bent: Vector) -> float:
        """Radians by which a limb turns about itself, so that it bends in its hinge; little where it is
        nearly straight. It goes on from the frame before, past half a turn too.
        """
        angle = math.acos(max(-1.0, min(1.0, dot(along, bent))))
        share = min(max((angle - _STRAIGHT) / (_BENT - _STRAIGHT), 0.0), 1.0)
        radians = twist(along, hinge, bent)
        if not share or radians is None:
            self._twists.pop(bone, None)
            return 0.0
        before = self._twists.get(bone, 0.0)
        radians += math.tau * round((before - radians) / math.tau)
        if abs(radians) > _MOST_TWIST:
            radians -= math.copysign(math.tau, radians)
        self._twists[bone] = radians
        return radians * ease(share)


def rest_points(skeleton: Skeleton) -> dict[str, Vector]:
    """Where the points would be on the figure in its T-pose, metres."""
    world = humanoid_rest(skeleton)
    places = quaternion.rotate(world[[max(parent, 0) for parent in skeleton.parents]], skeleton.offsets)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            places[joint] += places[parent]
    roles, at = skeleton.roles, [(x, y, z) for x, y, z in places.tolist()]
    rest = {"hips": at[roles.get("hips", 0)]}
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        for chain in _CHAINS:
            for above, part in zip(("", *chain), chain, strict=False):
                before, found = (
                    rest.get(f"{side} {above}", rest["hips"]),
                    roles.get(f"{side} {_JOINTS[part]}"),
                )
                x, y, z = minus(_T_POSE[part], _T_POSE.get(above, (0.0, 0.0, 0.0)))
                ideal = before[0] + sign * x, before[1] + y, before[2] + z
                rest[f"{side} {part}"] = ideal if found is None else at[found]
    trunk = _middle(rest, "hip"), _middle(rest, "shoulder")
    rest["chest"] = at[roles["chest"]] if "chest" in roles else middle(*trunk)
    return rest


def _elbow_hinge(rest: Points, side: str) -> Vector:
    """The way in which the forearm bends in the T-pose: as far as it is bent there, else to the front."""
    upper = unit(minus(rest[f"{side} elbow"], rest[f"{side} shoulder"]))
    lower = unit(minus(rest[f"{side} wrist"], rest[f"{side} elbow"]))
    if upper is None or lower is None or dot(upper, lower) > math.cos(_LEAST_BEND):
        return _FRONT
    return lower if lower[2] > math.sin(_LEAST_BEND) else _FRONT


def _frame(rest: Vector, rest_beside: Vector, now: Vector, beside: Vector) -> Quaternion | None:
    """The turn that brings one direction to another exactly, and a second one as near as it can."""
    start, end = unit(rest), unit(now)
    if start is None or end is None:
        return None
    turn = swing(start, end)
    radians = twist(end, rotated(turn, rest_beside), beside)
    return None if radians is None else multiplied(about(end, radians), turn)


def _middle(points: Points, part: str) -> Vector:
    return middle(points[f"left {part}"], points[f"right {part}"])


def _across(points: Points, part: str) -> Vector:
    """From the right one to the left one."""
    return minus(points[f"left {part}"], points[f"right {part}"])
