"""Torso, arms and legs of any skeleton, by its shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from appliance.pose.anatomy import Anatomy
from appliance.pose.skeleton import Skeleton
from appliance.studio.studio_error import StudioError


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
