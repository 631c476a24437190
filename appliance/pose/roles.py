"""Which joint of a skeleton is which part of a body, by its names: left upper arm, chest, right foot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from appliance.pose.joint_names import JointRole, place_of, shared_prefix

MIDDLE = ("hips", "spine", "chest", "neck", "head")
LIMBS = ("collar", "upper arm", "forearm", "hand", "thigh", "shin", "foot", "toe")
SIDES = {1: "left", -1: "right"}
ROLES = (*MIDDLE, *(f"{side} {part}" for side in SIDES.values() for part in LIMBS))
UPPER_ARMS = ("left upper arm", "right upper arm")
# Without these a figure cannot be stood up, held or mirrored: their absence is said.
_ESSENTIAL_LIMBS = ("upper arm", "forearm", "thigh", "shin", "foot")
ESSENTIAL = ("hips", "head", *(f"{side} {part}" for side in SIDES.values() for part in _ESSENTIAL_LIMBS))
_HELD = (*UPPER_ARMS, "left forearm", "head", "chest", "left thigh")
_HIPS, _WAIST, _SPINE, _CHEST, _UPPER_CHEST, _NECK, _HEAD = range(7)


def places_of(names: Sequence[str]) -> list[JointRole | None]:
    """For each joint its place on a figure, None for an unknown name; a prefix of most names is ignored."""
    prefix = shared_prefix(names)
    return [place_of(name) or place_of(name.removeprefix(prefix)) for name in names]


def roles_of(names: Sequence[str]) -> dict[str, int]:
    """Role ('left upper arm') to joint, for the roles whose joint is named; parents come before children.

    'Shoulder' is the collar bone where the skeleton has an upper arm of another name and no collar, else the
    upper arm. 'Foot' is the toe where there is an ankle. The hips are the last of several: a root may be on
    the floor. The spine is the trunk's first joint, the chest its last one.
    """
    places = places_of(names)
    found: dict[str, int] = {}

    def named(chain: str, side: int, *wanted: int) -> list[int]:
        known = [(joint, place) for joint, place in enumerate(places) if place is not None]
        return [joint for joint, place in known if place[:2] == (chain, side) and place.place in wanted]

    def take(role: str, joints: Sequence[int], last: bool = False) -> None:
        if joints:
            found[role] = joints[-1 if last else 0]

    take("hips", named("spine", 0, _HIPS), last=True)
    trunk = trunk_of(places)
    take("spine", trunk if len(trunk) > 1 or named("spine", 0, _WAIST, _SPINE) else [])
    take("chest", trunk if len(trunk) > 1 or named("spine", 0, _CHEST, _UPPER_CHEST) else [], last=True)
    take("neck", named("spine", 0, _NECK))
    take("head", named("spine", 0, _HEAD))
    for side, word in SIDES.items():
        collar, shoulder, arm = (named("arm", side, place) for place in (0, 1, 2))
        take(f"{word} collar", collar or (shoulder if arm else []))
        take(f"{word} upper arm", arm or shoulder)
        take(f"{word} forearm", named("arm", side, 3))
        take(f"{word} hand", named("arm", side, 4) or named("arm", side, 5))
        take(f"{word} thigh", named("leg", side, 1), last=True)
        take(f"{word} shin", named("leg", side, 2))
        ankle, foot, toe = (named("leg", side, place) for place in (3, 4, 5))
        take(f"{word} foot", ankle or foot)
        take(f"{word} toe", toe or (foot if ankle else []))
    return found


def trunk_of(places: Sequence[JointRole | None]) -> list[int]:
    """Joints between hips and neck, upwards; a waist below a named spine is left out."""
    trunk = [j for j, p in enumerate(places) if p is not None and p.chain == "spine" and 0 < p.place < _NECK]
    spine = [j for j in trunk if (p := places[j]) is not None and p.place == _SPINE]
    return [j for j in trunk if not spine or (p := places[j]) is None or p.place != _WAIST]


def held_joints(joints: Sequence[str]) -> dict[str, str]:
    """The parts on which hands are tried ('left upper arm') to names of joints that the network moves."""
    roles = roles_of(joints)
    if "chest" not in roles and "spine" in roles:
        roles["chest"] = roles["spine"]
    return {part: joints[roles[part]] for part in _HELD if part in roles}


def missing_roles(roles: Mapping[str, int]) -> list[str]:
    """The parts that a body needs and no joint's name says."""
    return [role for role in ESSENTIAL if role not in roles]
