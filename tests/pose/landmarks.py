"""Points as a camera program sees them on a figure: made by forward kinematics from a known pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import humanoid_rest, t_pose

JOINTS = {  # a point to the part of a body whose joint is there
    "shoulder": "upper arm", "elbow": "forearm", "wrist": "hand",
    "hip": "thigh", "knee": "shin", "ankle": "foot",
}  # fmt: skip
HEIGHT = 0.07  # of the face over the head's joint, metres


class Landmarks:
    """Sees the points of any layout on a figure."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton, self._roles = skeleton, skeleton.roles
        self._upright = quaternion.inverse(humanoid_rest(skeleton))
        places = t_pose(skeleton, 25.0).positions  # the arms' directions in the T-pose
        self._hands: dict[str, Array] = {}
        for side in ("left", "right"):
            along = places[self._roles[f"{side} hand"]] - places[self._roles[f"{side} forearm"]]
            self._hands[side] = along / np.linalg.norm(along)

    def seen(self, parts: Sequence[str], pose: Array, root: Array) -> Array:
        """(points, 3) in metres; not numbers for parts that say nothing."""
        positions, world = self.skeleton.forward_kinematics(pose.astype(float), root.astype(float))
        turns = quaternion.multiply(world, self._upright)
        found = np.full((len(parts), 3), np.nan)
        for place, part in enumerate(parts):
            side, _, name = part.rpartition(" ")
            sign = -1.0 if side == "right" else 1.0
            joint = self._roles.get(f"{side} {JOINTS[name]}" if name in JOINTS else part, -1)
            on: Sequence[float] | Array = (0.0, 0.0, 0.0)
            if name in ("nose", "eye", "ear", "head"):
                joint = self._roles["head"]
                depth = {"nose": 0.12, "eye": 0.12, "ear": 0.0, "head": 0.0}[name]
                on = (0.07 * sign * (name in ("eye", "ear")), HEIGHT, depth)
            elif name in ("index", "little", "thumb", "hand"):
                joint, along = self._roles[f"{side} hand"], self._hands[side]
                beside = np.array([0.0, 0.0, 1.0]) - along[2] * along
                on = (
                    0.08 * along + {"index": 0.03, "little": -0.03, "thumb": 0.03, "hand": 0.0}[name] * beside
                )
            elif name == "toe":
                joint = self._roles[f"{side} foot"]
                on = (0.0, -0.05, 0.14)
            if part and joint >= 0:
                found[place] = positions[joint] + quaternion.rotate(turns[joint], np.array(on))
        return found
