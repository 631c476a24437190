"""Body parts by their usual joint names, on any skeleton: the joints on which hands are tried."""

from __future__ import annotations

from collections.abc import Sequence

# The first name of a line that the network moves wins; case and punctuation do not count. 'LeftShoulder'
# is the upper arm of some skeletons and the collar bone of others, which have a 'LeftArm' as well.
USUAL_NAMES = {
    "left upper arm": "lshldr leftarm leftupperarm upperarml lhumerus leftshoulder lshoulder",
    "right upper arm": "rshldr rightarm rightupperarm upperarmr rhumerus rightshoulder rshoulder",
    "left forearm": "lforearm leftforearm leftlowerarm forearml lowerarml lradius leftelbow lelbow",
    "head": "head",
    "chest": "chest spine2 spine3 upperchest thorax spine1 t8 spine",
    "left thigh": "lthigh leftupleg leftupperleg leftthigh thighl lfemur lefthip lhip",
}
UPPER_ARMS = ("left upper arm", "right upper arm")


def usual_joints(joints: Sequence[str]) -> dict[str, str]:
    """Body part ('left upper arm') to joint name, for those that the network moves."""
    folded = {_folded(name): name for name in reversed(joints)}
    found = {
        part: next((folded[name] for name in names.split() if name in folded), None)
        for part, names in USUAL_NAMES.items()
    }
    return {part: name for part, name in found.items() if name is not None}


def _folded(name: str) -> str:
    return "".join(letter for letter in name.split(":")[-1].casefold() if letter.isalnum())
