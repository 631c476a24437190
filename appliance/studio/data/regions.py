"""Torso, arms and legs of any skeleton, by its shape; and a dance of which only a part is put on a phrase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton, UnknownJointError
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.studio_error import StudioError

NAMES = ("arms", "legs", "torso")


@dataclass(frozen=True)
class Regions:
    """Places of the joints of each region among the joints that the network moves."""

    torso: list[int]
    arms: list[int]
    legs: list[int]


def regions_of(skeleton: Skeleton, joints: Sequence[str], cure: str = "") -> Regions:
    """Torso, arms and legs among the joints that move, found by the skeleton's shape.

    Raises StudioError where it has no pair of limbs above and below; cure: what then to do.
    """
    anatomy = Anatomy(skeleton)
    arms, legs = set[int](), set[int]()
    for _, first in anatomy.limbs():
        limb = [first, *anatomy.below(first)]
        goes_down = (
            anatomy.positions[limb, 1].min() < anatomy.positions[anatomy.trunk[0], 1] - 0.2 * anatomy.height
        )
        (legs if goes_down else arms).update(limb)
    places = {name: place for place, name in enumerate(joints)}

    def among(chosen: set[int] | list[int]) -> list[int]:
        return sorted(places[skeleton.names[joint]] for joint in chosen if skeleton.names[joint] in places)

    found = Regions(among(anatomy.trunk), among(arms), among(legs))
    if not (found.torso and found.arms and found.legs):
        raise StudioError(
            f"This skeleton has no arms and legs that can be told apart from a torso. {cure}".strip()
        )
    return found


def joints_of(regions: Sequence[str], skeleton: Skeleton, moving: Sequence[int]) -> list[int]:
    """The moving joints of regions: of NAMES, or a part ('left upper arm') or joint with all below it.

    Raises StudioError for a name that is none of these.
    """
    found = set[int]()
    for region in regions:
        if region in NAMES:
            names = [skeleton.names[joint] for joint in moving]
            own = getattr(regions_of(skeleton, names, "Name joints instead."), region)
            found.update(moving[place] for place in own)
            continue
        try:
            joint = skeleton.roles[region] if region in skeleton.roles else skeleton.index(region)
        except UnknownJointError as error:
            known = ", ".join((*NAMES, *skeleton.roles))
            raise StudioError(f"--region {region}: {error} Parts of this body: {known}.") from None
        found.update(set(skeleton.descendants(joint)) & set(moving))
    if not found:
        raise StudioError(f"Nothing moves in {' and '.join(regions)}. Name another --region.")
    return sorted(found)


def put_on_region(skeleton: Skeleton, phrase: Array, dance: Array, joints: Sequence[int]) -> Array:
    """Poses (T, J, 4) of a phrase with these joints of a dance; all other joints are the phrase's.

    A joint that hangs on one of the phrase's is turned half as in the dance's own body, half as in the room
    (headings apart): where both bodies are alike it is the dance's. The root keeps the phrase's heading.
    """
    count = min(len(phrase), len(dance))
    own, made = phrase[:count], dance[:count]
    whole = own.copy()
    whole[:, list(joints)] = made[:, list(joints)]
    level = without_heading(made)
    if 0 in joints:
        whole[:, 0] = quaternion.multiply(quaternion.heading(own[:, 0]), level[:, 0])
    zero = np.zeros((count, 3))
    ours, theirs = (skeleton.forward_kinematics(each, zero)[1] for each in (without_heading(own), level))
    for joint in joints:
        parent = skeleton.parents[joint]
        if parent >= 0 and parent not in joints:
            in_room = quaternion.multiply(quaternion.inverse(ours[:, parent]), theirs[:, joint])
            whole[:, joint] = quaternion.slerp(made[:, joint], in_room, np.full(count, 0.5))
    mixed: Array = quaternion.continuous(quaternion.normalize(whole))
    return mixed
