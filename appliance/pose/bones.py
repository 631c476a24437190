"""Lengths of a skeleton's bones: which joints are limb ends or small parts, and the span of a body."""

from __future__ import annotations

import numpy as np

from appliance.pose.skeleton import Skeleton

SMALL = 0.042  # fraction of the span: a finger has 0.04 at most, a toe 0.03, a head 0.045, a foot 0.054
LIMB_END = 0.15  # fraction of the skeleton's reach: parts below a head, hand or foot are no longer than this


def small_parts(skeleton: Skeleton) -> set[int]:
    """Fingers, toes, eyes: joints with little below them, or with nothing below and a short bone."""
    reach, least = skeleton.reaches, SMALL * span_m(skeleton)
    known = (reach > 0) | (np.linalg.norm(skeleton.offsets, axis=-1) < least)
    return set(np.flatnonzero(known & (reach < least)).tolist()) - {0}


def span_m(skeleton: Skeleton) -> float:
    """The longest path along bones between two ends of the body: from a hand to a foot."""
    reach, longest = skeleton.reaches, 0.0
    for joint in range(len(skeleton)):
        arms = [
            reach[child] + float(np.linalg.norm(skeleton.offsets[child]))
            for child, parent in enumerate(skeleton.parents)
            if parent == joint
        ]
        longest = max(longest, sum(sorted(arms)[-2:]))
    return longest


def limb_ends(skeleton: Skeleton) -> set[int]:
    """Heads, hands, feet and smaller parts: by name, or because little is below them."""
    reach = skeleton.reaches
    small = set(np.flatnonzero(reach <= LIMB_END * reach[0]).tolist())
    heads = set() if skeleton.head is None else {skeleton.head}
    return (small | heads | set(skeleton.feet)) - {0}
