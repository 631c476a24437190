"""Unity's humanoid bone names for the joint names of motion capture skeletons."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.pose.joint_names import FINGERS
from appliance.pose.roles import SIDES, places_of, roles_of, trunk_of

_LIMBS = {
    "collar": "Shoulder", "upper arm": "UpperArm", "forearm": "LowerArm", "hand": "Hand",
    "thigh": "UpperLeg", "shin": "LowerLeg", "foot": "Foot", "toe": "Toes",
}  # fmt: skip
_FINGERS = dict(zip(FINGERS, ("Thumb", "Index", "Middle", "Ring", "Little"), strict=True))
_PHALANXES = {0: "Proximal", 1: "Proximal", 2: "Intermediate", 3: "Distal"}


def humanoid_bones(joints: Sequence[str]) -> dict[str, int]:
    """Unity bone name -> index of the joint that moves it; the first joint wins, unknown ones are left out.

    In a trunk of several joints the first is the spine, the second the chest, the last the upper chest. A
    skeleton without a known hip gives its root to Hips: without Hips nothing moves.
    """
    roles, places = roles_of(joints), places_of(joints)
    bones: dict[str, int] = {}
    for name in ("hips", "neck", "head"):
        if name in roles:
            bones[name.capitalize()] = roles[name]
    bones |= _trunk(trunk_of(places), roles)
    for side in SIDES.values():
        for part, bone in _LIMBS.items():
            if f"{side} {part}" in roles:
                bones[f"{side.capitalize()}{bone}"] = roles[f"{side} {part}"]
    for joint, place in enumerate(places):
        if place is None or place.place or not place.side:
            continue
        side = SIDES[place.side].capitalize()
        if place.chain == "eye":
            bones.setdefault(f"{side}Eye", joint)
        elif place.chain in _FINGERS and place.number in _PHALANXES:
            bones.setdefault(f"{side}{_FINGERS[place.chain]}{_PHALANXES[place.number]}", joint)
    if "Hips" not in bones:
        bones = {"Hips": 0} | {bone: joint for bone, joint in bones.items() if joint != 0}
    return bones


def _trunk(trunk: Sequence[int], roles: dict[str, int]) -> dict[str, int]:
    if len(trunk) < 2:
        return {role.capitalize(): roles[role] for role in ("spine", "chest") if role in roles}
    upper = {"UpperChest": trunk[-1]} if len(trunk) > 2 else {}
    return {"Spine": trunk[0], "Chest": trunk[1], **upper}
