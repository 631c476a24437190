"""The trunk as a tube along the spine, and the arms beside it, on any skeleton with the usual names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from appliance.pose.roles import UPPER_ARMS
from appliance.pose.skeleton import Skeleton

TRUNK_RADIUS = 0.5  # of the distance between the shoulders: 11 cm for the CMU dancers


class Arm(NamedTuple):
    """shoulder, elbow, wrist: joints that turn upper arm, forearm and hand; above: the shoulder's parent."""

    above: int
    shoulder: int
    elbow: int
    wrist: int


@dataclass(frozen=True)
class Trunk:
    """spine: joints from the neck (or what carries the head) down to the root; radius_m: of the tube."""

    spine: tuple[int, ...]
    arms: tuple[Arm, ...]
    radius_m: float

    @classmethod
    def of(cls, skeleton: Skeleton) -> Trunk | None:
        """None where head or arms are not named."""
        named = skeleton.roles
        if "head" not in named or any(part not in named for part in UPPER_ARMS):
            return None
        spine = skeleton.ancestors(named["head"])[1:]
        arms = []
        for part in UPPER_ARMS:
            shoulder = named[part]
            elbow = _longest(skeleton, shoulder)
            wrist = None if elbow is None else _longest(skeleton, elbow)
            if elbow is None or wrist is None or shoulder == 0:
                return None
            arms.append(Arm(skeleton.parents[shoulder], shoulder, elbow, wrist))
        positions, _ = skeleton.forward_kinematics(skeleton.standing, np.zeros(3))
        apart = float(np.linalg.norm(positions[arms[0].shoulder] - positions[arms[1].shoulder]))
        return cls(tuple(spine), tuple(arms), TRUNK_RADIUS * apart) if len(spine) > 1 else None


def _longest(skeleton: Skeleton, joint: int) -> int | None:
    """The joint at the end of the longest bone below."""
    below = [child for child, parent in enumerate(skeleton.parents) if parent == joint]
    return max(below, key=lambda child: float(np.linalg.norm(skeleton.offsets[child])), default=None)
