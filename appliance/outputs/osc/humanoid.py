"""Unity's humanoid bone names for the joint names of motion capture skeletons."""

from __future__ import annotations

import re
from collections.abc import Sequence

# Names of Daz (CMU's cgspeed files), MotionBuilder, Mixamo and Xsens, lower case and without their side.
_CENTRE = {
    "hip": "Hips", "hips": "Hips", "pelvis": "Hips",
    "abdomen": "Spine", "spine": "Spine",
    "chest": "Chest", "spine1": "Chest",
    "upperchest": "UpperChest", "spine2": "UpperChest",
    "neck": "Neck", "head": "Head", "jaw": "Jaw",
}  # fmt: skip
_SIDED = {
    "collar": "Shoulder", "shoulder": "Shoulder",
    "shldr": "UpperArm", "arm": "UpperArm", "upperarm": "UpperArm",
    "forearm": "LowerArm", "lowerarm": "LowerArm", "elbow": "LowerArm", "hand": "Hand", "wrist": "Hand",
    "thigh": "UpperLeg", "upleg": "UpperLeg", "upperleg": "UpperLeg", "hip": "UpperLeg",
    "shin": "LowerLeg", "leg": "LowerLeg", "lowerleg": "LowerLeg", "knee": "LowerLeg",
    "foot": "Foot", "ankle": "Foot", "toe": "Toes", "toes": "Toes", "toebase": "Toes", "eye": "Eye",
}  # fmt: skip
_FINGERS = {
    "thumb": "Thumb", "index": "Index", "mid": "Middle", "middle": "Middle",
    "ring": "Ring", "pinky": "Little", "little": "Little",
}  # fmt: skip
_PHALANXES = {"": "Proximal", "1": "Proximal", "2": "Intermediate", "3": "Distal"}
_SIDE = re.compile(r"(left|right|l|r)(.+)")
_FINGER = re.compile(rf"(?:hand)?({'|'.join(_FINGERS)})([123]?)")


def humanoid_bones(joints: Sequence[str]) -> dict[str, int]:
    """Unity bone name -> index of the joint that moves it; the first joint wins, unknown ones are left out.

    Where there are collars, a shoulder is the joint of the upper arm (Xsens), else it is the collar bone
    (MotionBuilder). A skeleton without a known hip gives its root to Hips: without Hips nothing moves.
    """
    collars = any("collar" in name.lower() for name in joints)
    bones: dict[str, int] = {}
    for index, name in enumerate(joints):
        bone = humanoid_bone(name, collars)
        if bone:
            bones.setdefault(bone, index)
    if "Hips" not in bones:
        bones = {"Hips": 0} | {bone: joint for bone, joint in bones.items() if joint != 0}
    return bones


def humanoid_bone(joint: str, collars: bool = False) -> str | None:
    """Unity's name for one joint, None if it has none: 'lShldr', 'mixamorig:LeftArm' -> 'LeftUpperArm'."""
    name = re.sub(r"[\s_.-]", "", joint.rsplit(":", 1)[-1]).lower()
    if name in _CENTRE:
        return _CENTRE[name]
    sided = _SIDE.fullmatch(name)
    if not sided:
        return None
    side = "Left" if sided[1].startswith("l") else "Right"
    if sided[2] == "shoulder" and collars:
        return f"{side}UpperArm"
    if sided[2] in _SIDED:
        return side + _SIDED[sided[2]]
    finger = _FINGER.fullmatch(sided[2])
    return f"{side}{_FINGERS[finger[1]]}{_PHALANXES[finger[2]]}" if finger else None
