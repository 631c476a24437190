"""The trunk as a tube along spine and skull, and the arms beside it, on any skeleton with the usual names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from appliance.dancer.two_bones import vector
from appliance.pose import quaternion
from appliance.pose.roles import UPPER_ARMS
from appliance.pose.skeleton import Skeleton
from appliance.pose.turns import Vector

TRUNK_RADIUS = 0.5  # fraction of the distance between the shoulders: 11 cm for the CMU dancers
SKULL = 0.7  # fraction of that radius: from the head's joint upwards, where the tube ends in a ball


class Arm(NamedTuple):
    """shoulder, elbow, wrist: joints that turn upper arm, forearm and hand; above: the shoulder's parent."""

    above: int
    shoulder: int
    elbow: int
    wrist: int


@dataclass(frozen=True)
class Trunk:
    """spine: joints from the neck (or what carries the head) down to the root; radius_m: of the tube.

    skull: from the head's joint to the middle of the skull, metres in the joint's own frame.
    """

    spine: tuple[int, ...]
    arms: tuple[Arm, ...]
    radius_m: float
    head: int
    skull: Vector

    @classmethod
    def of(cls, skeleton: Skeleton) -> Trunk | None:
        """None where head or arms are not named."""
        named = skeleton.roles
        if "head" not in named or any(part not in named for part in UPPER_ARMS):
            return None
        head = named["head"]
        spine = skeleton.ancestors(head)[1:]
        arms = []
        for part in UPPER_ARMS:
            shoulder = named[part]
            elbow = _longest(skeleton, shoulder)
            wrist = None if elbow is None else _longest(skeleton, elbow)
            if elbow is None or wrist is None or shoulder == 0:
                return None
            arms.append(Arm(skeleton.parents[shoulder], shoulder, elbow, wrist))
        if len(spine) < 2:
            return None
        positions, world = skeleton.forward_kinematics(skeleton.standing, np.zeros(3))
        apart = float(np.linalg.norm(positions[arms[0].shoulder] - positions[arms[1].shoulder]))
        radius_m = TRUNK_RADIUS * apart
        up = quaternion.rotate(quaternion.inverse(world[head]), np.array([0.0, SKULL * radius_m, 0.0]))
        return cls(tuple(spine), tuple(arms), radius_m, head, vector(up.tolist()))


def _longest(skeleton: Skeleton, joint: int) -> int | None:
    """The joint at the end of the longest bone below."""
    below = [child for child, parent in enumerate(skeleton.parents) if parent == joint]
    return max(below, key=lambda child: float(np.linalg.norm(skeleton.offsets[child])), default=None)
