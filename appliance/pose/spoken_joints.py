"""The joints of a skeleton in people's words: left shoulder for lShldr, lower back for abdomen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from appliance.pose.joint_names import FINGERS, JointRole
from appliance.pose.roles import SIDES, places_of, roles_of

_TRUNK = {1: "lower back", 2: "back", 3: "chest", 4: "upper chest"}
_MIDDLE = {**_TRUNK, 5: "neck", 6: "head"}
# By chain and place in joint_names: the bone that the joint turns.
_BONES = {
    ("arm", 0): "collarbone",
    ("arm", 1): "shoulder",
    ("arm", 2): "upper arm",
    ("arm", 3): "forearm",
    ("arm", 4): "wrist",
    ("arm", 5): "hand",
    ("leg", 0): "hip",
    ("leg", 1): "thigh",
    ("leg", 2): "lower leg",
    ("leg", 3): "ankle",
    ("leg", 4): "foot",
    ("leg", 5): "toes",
    ("eye", 0): "eye",
    ("finger", 0): "fingers",
    **{(finger, 0): f"{finger} finger" for finger in FINGERS},
    ("thumb", 0): "thumb",
    ("pinky", 0): "little finger",
}
# Where the skeleton names the joint, not the bone, people read the joint: these letters are in its name.
_JOINTS = {
    ("arm", 2): ("shoulder", ("shoulder", "shldr")),
    ("arm", 3): ("elbow", ("elbow", "ひじ", "肘")),
    ("leg", 1): ("hip", ("hip",)),
    ("leg", 2): ("knee", ("knee", "ひざ", "膝")),
}
PARTS = ("hips", *_MIDDLE.values(), "middle back")
SIDED_PARTS = {*_BONES.values(), *(joint for joint, _ in _JOINTS.values())}


def spoken_joints(names: Sequence[str]) -> list[str]:
    """For each joint a part of PARTS, or a side and one of SIDED_PARTS; '' for a name that is not understood.

    Several of one kind have a number, the parent first: 'right index finger 2'.
    """
    places, roles = places_of(names), roles_of(names)
    spoken = [_spoken(joint, name, places[joint], roles) for joint, name in enumerate(names)]
    trunk = [joint for joint, part in enumerate(spoken) if part in _TRUNK.values()]
    if len({spoken[joint] for joint in trunk}) < len(trunk):  # such as Spine, Spine1, Spine2
        for joint in trunk:
            spoken[joint] = "middle back"
        spoken[trunk[0]], spoken[trunk[-1]] = "lower back", "chest"
    often, so_far = Counter(spoken), Counter[str]()
    for joint, part in enumerate(spoken):
        so_far[part] += 1
        if part and often[part] > 1:
            spoken[joint] = f"{part} {so_far[part]}"
    return spoken


def _spoken(joint: int, name: str, place: JointRole | None, roles: Mapping[str, int]) -> str:
    if place is None:
        return ""
    if place.chain == "spine":
        return _MIDDLE.get(place.place, "hips" if roles.get("hips") == joint else "")
    where = place.chain, place.place
    if not place.side or where not in _BONES:
        return ""
    side = SIDES[place.side]
    if roles.get(f"{side} collar") == joint:  # 'shoulder' is the collarbone where there is an upper arm
        return f"{side} collarbone"
    part, letters = _JOINTS.get(where, ("", ()))
    is_joint = any(one in name.casefold() for one in letters)
    return f"{side} {part if is_joint else _BONES[where]}"
