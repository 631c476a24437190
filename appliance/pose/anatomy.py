"""Finds the joints of any kind of skeleton: trunk, limbs, hands, feet, head, and the front."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.joint_names import side_of
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

LONG_BRANCH = 0.25  # fraction of the height; a longer branch is a limb, a shorter one a finger or a face
LONG_BONE = 0.08  # fraction of the height: a limb begins at its first bone of this length
_UP = np.array([0.0, 1.0, 0.0])


class Anatomy:
    """The parts of a skeleton of any kind, from its shape; names matter for the head and for left and right.

    pose: (J, 4) local rotations in which the body is modelled; left out: as it stands.
    """

    def __init__(self, skeleton: Skeleton, pose: Array | None = None) -> None:
        self.skeleton = skeleton
        joints = len(skeleton)
        self.positions, self.world = skeleton.forward_kinematics(
            skeleton.standing if pose is None else pose, np.zeros(3)
        )
        self.children: list[list[int]] = [[] for _ in range(joints)]
        for joint, parent in enumerate(skeleton.parents):
            if parent >= 0:
                self.children[parent].append(joint)
        self.tips = [
            (joint, self.positions[joint] + quaternion.rotate(self.world[joint], np.array(offset)))
            for joint, offset in skeleton.ends
        ]
        points = np.vstack([self.positions, *(tip for _, tip in self.tips)])
        self.height = float(np.ptp(points, axis=0).max()) or 1.0
        self.reach = self._reaches()
        self.head = skeleton.head
        self.trunk = self._trunk()

    def length(self, joint: int) -> float:
        """Metres from the parent joint."""
        return float(np.linalg.norm(self.skeleton.offsets[joint]))

    def thickness(self, joint: int) -> float:
        """Radius of a limb at a joint, metres: thick where much hangs below."""
        share = self.reach[joint] / self.height
        return float(self.height * min(0.0165 + 0.078 * share * share, 0.050))

    def below(self, joint: int) -> list[int]:
        """All joints that hang below one."""
        found: list[int] = []
        for child in self.children[joint]:
            found += [child, *self.below(child)]
        return found

    def long_children(self, joint: int) -> list[int]:
        """Children that a limb, or more of the trunk, hangs below."""
        return [child for child in self.children[joint] if self.reach[child] > LONG_BRANCH * self.height]

    def limbs(self) -> list[tuple[int, int]]:
        """(trunk joint, first joint beyond it) of each limb: arms, legs, but not the neck."""
        return [
            (joint, child)
            for joint in self.trunk
            for child in self.long_children(joint)
            if child not in self.trunk and not self._leads_to_head(child)
        ]

    def part_of(self, joint: int) -> int:
        """The hand or foot that a finger or toe belongs to; any other joint is a separate part."""
        while self.reach[joint] < 0.10 * self.height and self.skeleton.parents[joint] >= 0:
            lengths = [float(np.linalg.norm(end - start)) for _, start, end in self.bones([joint])]
            if max(lengths, default=0.0) > 0.05 * self.height:
                break
            joint = self.skeleton.parents[joint]
        return joint

    def chain(self, joint: int) -> list[int]:
        """From a joint down the branch that reaches furthest until it ends or falls apart into fingers."""
        chain = [joint]
        while (below := self.children[chain[-1]]) and len(below) < 3:
            chain.append(max(below, key=lambda child: (self.reach[child] + self.length(child), -child)))
        return chain

    def limb_start(self, chain: list[int]) -> int:
        """The place in a limb's chain where its first long bone begins: shoulder or hip."""
        for place in range(len(chain) - 1):
            if self.length(chain[place + 1]) > LONG_BONE * self.height:
                return place
        return 0

    @cached_property
    def neck(self) -> list[int]:
        """From the first joint beyond the trunk to the head; empty without a head."""
        if self.head is None:
            return []
        chain = [self.head]
        while (parent := self.skeleton.parents[chain[0]]) >= 0 and parent not in self.trunk:
            chain.insert(0, parent)
        return chain

    @cached_property
    def is_person(self) -> bool:
        """Whether it has a head on an upright trunk, with limbs at both ends of it."""
        spine = self.positions[self.trunk[-1]] - self.positions[self.trunk[0]]
        legs = sum(trunk == self.trunk[0] for trunk, _ in self.limbs())
        upright = float(spine[1]) > 0.8 * float(np.linalg.norm(spine)) > 0.0
        return upright and legs > 1 and bool(self.neck)

    @cached_property
    def across(self) -> Array:
        """Unit vector to the dancer's left: along which pairs of limbs lie apart; (3,).

        Where no name tells left from right, to the positive side."""
        total = np.zeros(3)
        for joint in self.trunk:
            starts = [
                self.positions[chain[self.limb_start(chain)]]
                for trunk, first in self.limbs()
                if trunk == joint
                for chain in [self.chain(first)]
            ]
            for number, one in enumerate(starts):
                for other in starts[number + 1 :]:
                    apart = one - other
                    total += apart if float(apart @ (total if total.any() else apart)) >= 0 else -apart
        length = float(np.linalg.norm(total))
        side = total / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
        left = sum(
            float(self.positions[joint] @ side) * side_of(self.skeleton.names[joint])
            for joint in range(len(self.skeleton))
        )
        if abs(left) > 1e-3 * self.height:
            return side if left > 0 else -side
        return side if side[int(np.argmax(np.abs(side)))] > 0 else -side

    @cached_property
    def forward(self) -> Array:
        """Unit vector to the dancer's front: where toes or eyes are, else +Z; horizontal, (3,)."""
        ahead = self.bones([*self.skeleton.feet, *([] if self.head is None else [self.head])])
        hints = [end - start for _, start, end in ahead]
        total = np.sum(hints, axis=0) if hints else np.array([0.0, 0.0, 1.0])
        total = total * np.array([1.0, 0.0, 1.0])
        total -= self.across * float(total @ self.across)
        length = float(np.linalg.norm(total))
        if length < 0.01 * self.height:
            total = np.cross(self.across, _UP)
            length = float(np.linalg.norm(total)) or 1.0
        front: Array = total / length
        return front

    def bones(self, joints: Sequence[int]) -> list[tuple[int, Array, Array]]:
        """(joint that moves it, where it begins, where it ends) of some joints' bones, tips included."""
        found = [
            (joint, self.positions[joint], self.positions[child])
            for joint in joints
            for child in self.children[joint]
        ]
        found += [(joint, self.positions[joint], tip) for joint, tip in self.tips if joint in joints]
        return [bone for bone in found if float(np.linalg.norm(bone[2] - bone[1])) > 1e-4 * self.height]

    def _leads_to_head(self, joint: int) -> bool:
        return self.head is not None and (joint == self.head or self.head in self.below(joint))

    def _reaches(self) -> NDArray[np.float64]:
        """Metres of the longest chain of bones below each joint."""
        reach = np.zeros(len(self.skeleton))
        for joint, offset in self.skeleton.ends:
            reach[joint] = max(reach[joint], float(np.linalg.norm(offset)))
        for joint in reversed(range(1, len(self.skeleton))):
            parent = self.skeleton.parents[joint]
            reach[parent] = max(reach[parent], reach[joint] + self.length(joint))
        return reach

    def _trunk(self) -> list[int]:
        """Joints from which several limbs branch and those between, from the pelvis outwards."""
        branching = [joint for joint in range(len(self.skeleton)) if len(self.long_children(joint)) >= 2]
        pelvis = branching[0] if branching else 0
        trunk = {pelvis}
        for joint in branching:
            while joint not in trunk and joint >= 0:
                trunk.add(joint)
                joint = self.skeleton.parents[joint]
        return sorted(trunk)
