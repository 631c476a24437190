"""Lengths of a skeleton's bones: how far limbs reach, which joints are their ends, how large a body is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.pose.skeleton import Skeleton

SMALL = 0.042  # of the body's span: a finger has 0.04 at most, a toe 0.03, a head 0.045, a foot 0.054
LIMB_END = 0.15  # of the skeleton's reach: what hangs below a head, hand or foot is no longer than this


def reaches(skeleton: Skeleton) -> NDArray[np.float64]:
    """(J,): length in metres of the longest chain of bones below each joint."""
    reach = np.zeros(len(skeleton))
    for joint, offset in skeleton.ends:
        reach[joint] = max(reach[joint], float(np.linalg.norm(offset)))
    for joint in reversed(range(1, len(skeleton))):
        above = skeleton.parents[joint]
        reach[above] = max(reach[above], reach[joint] + float(np.linalg.norm(skeleton.offsets[joint])))
    return reach


def small_parts(skeleton: Skeleton) -> set[int]:
    """Fingers, toes, eyes: joints below which there is little, or nothing where their own bone is short."""
    reach, least = reaches(skeleton), SMALL * span_m(skeleton)
    known = (reach > 0) | (np.linalg.norm(skeleton.offsets, axis=-1) < least)
    return set(np.flatnonzero(known & (reach < least)).tolist()) - {0}


def span_m(skeleton: Skeleton) -> float:
    """The longest way along bones from one end of the body to another: a hand to a foot."""
    reach, longest = reaches(skeleton), 0.0
    for joint in range(len(skeleton)):
        arms = [
            reach[child] + float(np.linalg.norm(skeleton.offsets[child]))
            for child, parent in enumerate(skeleton.parents)
            if parent == joint
        ]
        longest = max(longest, sum(sorted(arms)[-2:]))
    return longest


def limb_ends(skeleton: Skeleton) -> set[int]:
    """Heads, hands, feet and what is smaller: by their names, or because little hangs below them."""
    reach = reaches(skeleton)
    small = set(np.flatnonzero(reach <= LIMB_END * reach[0]).tolist())
    heads = {joint for joint, name in enumerate(skeleton.names) if "head" in name.casefold()}
    return (small | heads | set(skeleton.feet)) - {0}
