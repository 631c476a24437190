"""The table of joint names: which place of a human figure a name means, in the words of the usual systems.

Rokoko, Xsens, Captury, OptiTrack, Mixamo, MotionBuilder, Unreal, Unity and VRM, Vicon, SMPL, Kinect, CMU
(BVH, ASF), Daz, Blender, mocopi, Biovision, iPi, Second Life, Roblox, Maya's rigs and MMD (Japanese). Every
guess about a joint's meaning in this house looks here.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

# Words for a joint, in their order along the chain; letter case and punctuation do not count, a number at the
# end is the joint's number.
CHAINS: dict[str, tuple[tuple[str, ...], ...]] = {
    "spine": (
        (
            *(
                "hips",
                "hip",
                "pelvis",
                "root",
                "hipmaster",
                "hipsmaster",
                "spinebase",
                "midhip",
                "lowertorso",
            ),
            *("全ての親", "センター", "グルーブ", "腰"),
        ),
        ("abdomen", "abdomenlower", "abdomenupper", "ab", "lowerback", "waist", "l5", "下半身"),
        ("spine", "back", "upperback", "l3", "lowerspine", "middlespine", "spinemid", "上半身"),
        ("torso", "torsoa", "torsob", "torsoc", "chest", "chestlower", "thorax", "t12", "uppertorso", "胸"),
        ("upperchest", "chestupper", "sternum", "spineshoulder", "upperspine", "t8"),
        ("neck", "lowerneck", "necklower", "upperneck", "neckupper", "首"),
        ("head", "skull", "頭"),
        ("headtop", "headend", "topofhead", "nose"),
    ),
    "arm": (
        ("collar", "clavicle", "scapula"),
        ("shoulder", "肩"),
        ("shldr", "shldrbend", "upperarm", "arm", "uparm", "uarm", "humerus", "腕"),
        ("elbow", "forearm", "forearmbend", "lowerarm", "lowarm", "larm", "farm", "radius", "ひじ", "肘"),
        ("wrist", "手首"),
        ("hand", "手"),
        ("handtip", "handend"),
    ),
    "leg": (
        ("buttock", "hipjoint"),
        ("hip", "upleg", "upperleg", "thigh", "thighbend", "femur", "足", "もも", "太もも"),
        ("knee", "leg", "shin", "calf", "lowerleg", "lowleg", "shank", "tibia", "ひざ", "膝", "すね"),
        ("ankle", "足首"),
        ("foot",),
        ("toe", "toebase", "ball", "toes", "つま先", "足先ex"),
        ("toeend", "toetip"),
    ),
    "eye": (("eye", "目"),),
    **{
        words[0]: (words, tuple(f"{word}tip" for word in words))
        for words in (
            ("thumb", "handthumb", "親指"),
            ("index", "handindex", "人指", "人差指", "人差し指"),
            ("middle", "mid", "handmiddle", "中指"),
            ("ring", "handring", "薬指"),
            ("pinky", "little", "handpinky", "小指"),
            ("finger", "fingerbase"),
        )
    },
}
FINGERS = ("thumb", "index", "middle", "ring", "pinky")
_PLACES = {
    (word, chain == "spine"): (chain, place)
    for chain, places in CHAINS.items()
    for place, words in enumerate(places)
    for word in words
}
_IN_FRONT = re.compile(
    r"^(.*[:|/\\]|mixamorig\d*_?|bip\d*[ _]|j_bip_c_|j_bip_|character\d*[_ ]|skeleton[ _]?\d*[_ ]|"
    r"joint_|jnt_|cc_base_|def[-_]|org[-_]|b_|c_|valvebiped[._]|bip\d+_|(?-i:m(?=[A-Z])))+(?=.)",
    re.IGNORECASE,
)
_PHALANXES = {"metacarpal": "4", "proximal": "1", "intermediate": "2", "medial": "2", "distal": "3"}
_FINGER = re.compile(rf"(?:finger(?P<finger>[1-5]))?(?P<phalanx>{'|'.join(_PHALANXES)})$")
_BEHIND = re.compile(r"[_.\- ](jnt|joint|bone|m)$", re.IGNORECASE)  # Maya's rigs: Spine1_M
_SIDES = (  # where a name has its side, the most explicit first; the rest must be a word of the table
    re.compile(r"^(?P<side>left|right|左|右)(?P<rest>.+)$"),
    re.compile(r"^(?P<rest>.+?)(?P<side>left|right)(?P<number>\d*)$"),
    re.compile(r"^(?P<rest>.+?)(?P<side>[lr])t(?P<number>\d*)$"),
    re.compile(r"^(?P<side>[lr])(?P<rest>.+)$"),
    re.compile(r"^(?P<rest>.+?)(?P<side>[lr])(?P<number>\d*)$"),
)
_LEFT = ("left", "l", "左")
# Where a prefix may end: behind a mark, and where a word or a number meets a capital letter.
_SEAM = re.compile(r"(?<=[_.:|/\\\- ])(?=.)|(?<=[a-z0-9])(?=[A-Z])")


class JointRole(NamedTuple):
    """Where a joint belongs: the chain, its side (1 left, -1 right, 0 middle), its place, its number."""

    chain: str
    side: int
    place: int
    number: int


def place_of(name: str) -> JointRole | None:
    """Where on a human figure a joint of this name is; None for a name that is not in the table."""
    folded = "".join(letter for letter in _without_frills(name).casefold() if letter.isalnum())
    for side, bone in ((0, folded), *_sided(folded)):
        word = _FINGER.sub(_numbered, bone)
        plain = word if (word, side == 0) in _PLACES else word.rstrip("0123456789")
        if not plain:
            continue
        known = _PLACES.get((plain, side == 0)) or _PLACES.get((re.sub(r"\d", "", plain), side == 0))
        if known is not None:
            digits = re.findall(r"\d+", word if plain != word else "")
            return JointRole(known[0], side, known[1], int(digits[-1]) if digits else 0)
    return None


def shared_prefix(names: Sequence[str]) -> str:
    """The longest beginning that at least half of the names have, up to a mark or a capital; '' without one.

    A performer or a rig in front of its joints: Model_Hips, Actor01_LeftArm. Other parts of the rig, such as
    props, have other beginnings.
    """
    counts = Counter(name[: seam.start()] for name in names for seam in _SEAM.finditer(name))
    often = (prefix for prefix, count in counts.items() if count >= max(2, len(names) / 2))
    return max(often, key=len, default="")


def side_of(name: str) -> int:
    """1 for names of the left, -1 of the right, 0 for the middle and for names that do not say.

    Also where the rest of the name is no word of the table.
    """
    known = place_of(name)
    if known is not None:
        return known.side
    plain = _without_frills(name)
    words = re.search(r"left|right", plain, re.IGNORECASE) or re.search(
        r"^[lr](?=[A-Z_.\- ])|(?<=[_.\- ])[lr](?=$|[_.\- \d])|(?<=[a-z])[LR]T?$",
        plain,
        re.IGNORECASE if re.search(r"(^|[_.\- ])[lr]([_.\- ]|$)", plain, re.IGNORECASE) else re.NOFLAG,
    )
    return 0 if words is None else 1 if words[0].casefold().startswith("l") else -1


def _numbered(bone: re.Match[str]) -> str:
    """'finger2proximal' (Rokoko) as 'index1', 'proximal' (Unity, behind the finger) as '1'."""
    return (FINGERS[int(bone["finger"]) - 1] if bone["finger"] else "") + _PHALANXES[bone["phalanx"]]


def _without_frills(name: str) -> str:
    """A name without what programs put before and behind it; wide letters and digits as the usual ones."""
    return _BEHIND.sub("", _IN_FRONT.sub("", unicodedata.normalize("NFKC", name)))


def _sided(folded: str) -> Iterator[tuple[int, str]]:
    """(side, the rest) by each way in which a name may say its side; a number stays at the end."""
    for pattern in _SIDES:
        found = pattern.match(folded)
        if found:
            parts = found.groupdict()
            yield (1 if parts["side"] in _LEFT else -1), parts["rest"] + (parts.get("number") or "")
