"""The pose of this show's figure from the turns of a person's bones, under Unity's names for these."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from itertools import pairwise

from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import humanoid_rest
from appliance.pose.turns import UNTURNED, Quaternion, inverse, multiplied

HIPS = "Hips"
SIDES = ("Left", "Right")
_TRUNK = ("UpperChest", "Chest", "Spine")  # from the arms down
_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
_PHALANXES = ("Proximal", "Intermediate", "Distal")
_BONES_ABOVE = {"Spine": HIPS, "Chest": "Spine", "UpperChest": "Chest", "Neck": "UpperChest", "Head": "Neck"}
for _side in SIDES:
    for _part, _above in (("Eye", "Head"), ("Shoulder", "UpperChest"), ("UpperLeg", HIPS)):
        _BONES_ABOVE[f"{_side}{_part}"] = _above
    for _chain in (
        ("Shoulder", "UpperArm", "LowerArm", "Hand"),
        ("UpperLeg", "LowerLeg", "Foot", "Toes"),
        *(("Hand", *(f"{finger}{one}" for one in _PHALANXES)) for finger in _FINGERS),
    ):
        _BONES_ABOVE |= {f"{_side}{one}": f"{_side}{above}" for above, one in pairwise(_chain)}
BONES = frozenset((HIPS, *_BONES_ABOVE))  # all of a Unity figure
OF_BODY = frozenset(  # without these a figure is not whole; fingers, eyes and toes few programs send
    (HIPS, "Spine", "Head", *(f"{side}{part}" for side in SIDES for part in (
        "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot"
    )))
)  # fmt: skip


class FigurePose:
    """Turns of bones in the room, counted from a T-pose that faces +Z, become the figure's local rotations.

    Joints between two bones go with the upper one. The last joint of a trunk that has fewer joints than the
    person takes the turn that the arms start from. joint_of: the bones of this figure.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self.joint_of = humanoid_bones(skeleton.names)
        self._parents = skeleton.parents
        rest: list[Quaternion] = [(w, x, y, z) for w, x, y, z in humanoid_rest(skeleton).tolist()]
        self._rest = rest
        self._from_above = [inverse(rest[parent]) if parent >= 0 else UNTURNED for parent in self._parents]
        self._bone_of = {joint: bone for bone, joint in self.joint_of.items()}
        self._bones_of = self._bones_of_joints()
        top = next((place for place, bone in enumerate(_TRUNK) if bone in self.joint_of), len(_TRUNK))
        self._top = _TRUNK[: top + 1]  # what may turn the last joint of the trunk

    def known(self, turned: Iterable[str]) -> frozenset[str]:
        """Bones of this figure that are known where these bones of a person are."""
        found = {self._top[-1] if bone in self._top else bone for bone in turned}
        return frozenset(found.intersection(self.joint_of))

    def missing(self, known: Collection[str]) -> list[str]:
        """Bones of this figure that did not come, those of the body first."""
        missing = [bone for bone in self.joint_of if bone not in known]
        return sorted(missing, key=lambda bone: bone not in OF_BODY)

    def rotations(self, turns: Mapping[str, Quaternion], known: Collection[str]) -> list[float]:
        """(J * 4) local rotations w, x, y, z; not numbers where no known bone says how a joint turns."""
        world: list[Quaternion] = []
        rotations: list[float] = []
        for joint, parent in enumerate(self._parents):
            above = world[parent] if parent >= 0 else UNTURNED
            turn = self._turn(self._bone_of.get(joint, ""), turns)
            world.append(above if turn is None else turn)
            if self._bones_of[joint].isdisjoint(known):
                rotations += (math.nan,) * 4
                continue
            local = UNTURNED if turn is None else multiplied(inverse(above), turn)
            rotations += multiplied(multiplied(self._from_above[joint], local), self._rest[joint])
        return rotations

    def _turn(self, bone: str, turns: Mapping[str, Quaternion]) -> Quaternion | None:
        if bone in self._top:
            bone = next((one for one in self._top if one in turns), bone)
        return turns.get(bone)

    def _bones_of_joints(self) -> list[frozenset[str]]:
        """For each joint the bones that say how it turns: its own, else the next ones below it."""
        found: list[frozenset[str]] = [frozenset()] * len(self._parents)
        for joint in reversed(range(len(self._parents))):
            if joint in self._bone_of:
                found[joint] = frozenset((self._bone_of[joint],))
            parent = self._parents[joint]
            if parent >= 0:
                found[parent] |= found[joint]
        return found


def in_room(locals_: Mapping[str, Quaternion]) -> dict[str, Quaternion]:
    """Turns in the room from those against the bone above in Unity's figure; a missing one is unturned."""
    found: dict[str, Quaternion] = {}

    def turn(bone: str) -> Quaternion:
        if bone not in found:
            above = UNTURNED if bone == HIPS else turn(_BONES_ABOVE[bone])
            found[bone] = multiplied(above, locals_[bone]) if bone in locals_ else above
        return found[bone]

    return {bone: turn(bone) for bone in locals_}
