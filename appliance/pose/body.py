"""Volume around any skeleton: rounded cones along its bones, thick where much hangs below a joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

LONG_BRANCH = 0.25  # fraction of the height; a longer branch is a limb, a shorter one a finger or a face


@dataclass(frozen=True)
class Cones:
    """Rounded cones: their start and end (C, 3) and radii there (C,), metres; the joint that moves each."""

    start: Array
    end: Array
    start_radius: Array
    end_radius: Array
    joint: NDArray[np.int64]


class Body:
    """Volume around a skeleton of any kind: thick where much hangs below a joint, thin at the fingers."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        rest, world = skeleton.forward_kinematics(skeleton.standing, np.zeros(3))
        self._upright = quaternion.inverse(world)
        self.height = float(np.ptp(np.vstack([rest, self._ends(rest, world)]), axis=0).max()) or 1.0
        self._trunk = self._trunk_joints()
        self._radius = self.height * np.clip(
            0.042 * (skeleton.reaches / self.height) ** 0.62 * 1.36, 0.011, None
        )
        self._radius[list(self._trunk)] = 0.055 * self.height
        self._radius[0] *= 0.7  # where the legs part
        self._head = skeleton.head

    def cones(self, positions: Array, world: Array) -> Cones:
        """The figure's volume for world positions (J, 3) and world rotations (J, 4)."""
        radius = self._radius
        face = [] if self._head is None else self.skeleton.descendants(self._head)[1:]
        parts = [(positions[0], positions[0], radius[0], radius[0], 0)]
        parts += [
            (positions[parent], positions[joint], radius[parent], radius[joint], parent)
            for joint, parent in enumerate(self.skeleton.parents)
            if parent >= 0 and joint not in face
        ]
        for (joint, _), tip in zip(self.skeleton.ends, self._ends(positions, world), strict=True):
            if joint not in face and joint != self._head:
                parts.append((positions[joint], tip, radius[joint], 0.8 * radius[joint], joint))
        for joint, limb in self._webs():
            parts.append((positions[joint], positions[limb], 0.9 * radius[joint], radius[limb], joint))
        if self._head is not None:
            turn = quaternion.multiply(world[self._head], self._upright[self._head])
            parts += self._head_cones(positions[self._head], turn)
        start, end, first, last, moved_by = zip(*parts, strict=True)
        return Cones(np.array(start), np.array(end), np.array(first), np.array(last), np.array(moved_by))

    def _head_cones(self, neck: Array, turn: Array) -> list[tuple[Array, Array, float, float, int]]:
        assert self._head is not None
        shapes = [
            ((0, 0.028, 0.014), 0.036, (0, 0.072, 0.004), 0.052),
            ((0, 0.045, 0.04), 0.014, (0, 0.03, 0.054), 0.009),
        ]
        return [
            (
                neck + quaternion.rotate(turn, self.height * np.array(a, float)),
                neck + quaternion.rotate(turn, self.height * np.array(b, float)),
                self.height * radius_a,
                self.height * radius_b,
                self._head,
            )
            for a, radius_a, b, radius_b in shapes
        ]

    def _ends(self, positions: Array, world: Array | None) -> Array:
        if not self.skeleton.ends:
            return np.empty((0, 3))
        joints = [joint for joint, _ in self.skeleton.ends]
        offsets = np.array([offset for _, offset in self.skeleton.ends], float)
        return positions[joints] + (offsets if world is None else quaternion.rotate(world[joints], offsets))

    def _long_children(self, joint: int) -> list[int]:
        return [
            child
            for child, parent in enumerate(self.skeleton.parents)
            if parent == joint and self.skeleton.reaches[child] > LONG_BRANCH * self.height
        ]

    def _trunk_joints(self) -> set[int]:
        """Joints from which several limbs branch, and those between them."""
        trunk: set[int] = set()
        for joint in range(len(self.skeleton)):
            if len(self._long_children(joint)) >= 2:
                while joint >= 0 and joint not in trunk:
                    trunk.add(joint)
                    joint = self.skeleton.parents[joint]
        return trunk

    def _webs(self) -> list[tuple[int, int]]:
        """Pairs (trunk joint, start of a limb) that fill the sides of the chest and of the pelvis."""
        pairs = []
        for branching in self._trunk:
            limbs = [c for c in self._long_children(branching) if c not in self._trunk]
            neighbours = [c for c in self._long_children(branching) if c in self._trunk]
            if self.skeleton.parents[branching] >= 0:
                neighbours.append(self.skeleton.parents[branching])
            for limb in limbs:
                beyond = self._long_children(limb)[:1]
                pairs += [(middle, start) for middle in neighbours for start in (limb, *beyond)]
        return pairs
