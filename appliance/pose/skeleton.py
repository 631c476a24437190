"""Skeleton: joint names, parents and offsets; forward kinematics turns a pose into world positions."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.roles import roles_of


class UnknownJointError(KeyError):
    """A joint name that the skeleton does not have; suggests the nearest one."""

    def __init__(self, name: str, names: Sequence[str]) -> None:
        by_folded = {known.casefold(): known for known in names}
        near = difflib.get_close_matches(name.casefold(), by_folded, n=1, cutoff=0.5)
        self.name, self.nearest = name, by_folded[near[0]] if near else None
        meant = f" Did you mean '{self.nearest}'?" if self.nearest else ""
        super().__init__(f"The skeleton has no joint '{name}'.{meant}")

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints in an order in which parents come first.

    names: J joint names; parents: index of each joint's parent, -1 for the root;
    offsets: (J, 3) metres from the parent joint, in the parent's frame, zero for the root;
    ends: where bones without a child joint end, as (joint, offset in metres);
    stance: (J, 4) local rotations in which the body stands, where the zero pose is no figure.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: NDArray[np.float64]
    ends: tuple[tuple[int, tuple[float, float, float]], ...] = ()
    stance: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Place of a joint; raises UnknownJointError naming the nearest one."""
        try:
            return self.names.index(name)
        except ValueError:
            raise UnknownJointError(name, self.names) from None

    def same_joints(self, other: Skeleton) -> bool:
        """Whether a pose of the other skeleton means the same here: equal names and parents."""
        return self.names == other.names and self.parents == other.parents

    @property
    def standing(self) -> NDArray[np.float64]:
        """(J, 4): the pose in which the body is modelled: the stance, else the zero pose."""
        if self.stance is not None:
            return self.stance
        return np.tile(quaternion.IDENTITY.astype(np.float64), (len(self), 1))

    @cached_property
    def roles(self) -> dict[str, int]:
        """Part of a body ('left upper arm') to joint, as far as the names say (roles.ROLES)."""
        return roles_of(self.names)

    @cached_property
    def feet(self) -> tuple[int, ...]:
        """Joints that stand on the floor: both feet by the table of names, else those named foot or ankle."""
        named = sorted(self.roles[role] for role in ("left foot", "right foot") if role in self.roles)
        if len(named) == 2:
            return tuple(named)
        return tuple(i for i, n in enumerate(self.names) if any(w in n.casefold() for w in ("foot", "ankle")))

    @cached_property
    def head(self) -> int | None:
        """The head by the table of names, else the first joint with 'head' in its name."""
        called = (joint for joint, name in enumerate(self.names) if "head" in name.casefold())
        return self.roles.get("head", next(called, None))

    @cached_property
    def reaches(self) -> NDArray[np.float64]:
        """(J,): length in metres of the longest chain of bones below each joint."""
        reach = np.zeros(len(self))
        for joint, offset in self.ends:
            reach[joint] = max(reach[joint], float(np.linalg.norm(offset)))
        for joint in reversed(range(1, len(self))):
            parent = self.parents[joint]
            reach[parent] = max(reach[parent], reach[joint] + float(np.linalg.norm(self.offsets[joint])))
        return reach

    def ancestors(self, joint: int) -> list[int]:
        """A joint and those above it, up to the root."""
        chain = [joint]
        while (joint := self.parents[joint]) >= 0:
            chain.append(joint)
        return chain

    def descendants(self, joint: int) -> list[int]:
        """A joint and all below it."""
        found = [joint]
        for child, parent in enumerate(self.parents):
            if parent in found:
                found.append(child)
        return found

    @cached_property
    def _levels(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], ...]:
        """(joints, their parents) for each depth of the tree below the root."""
        depth = [0] * len(self)
        for joint, parent in enumerate(self.parents):
            depth[joint] = 0 if parent < 0 else depth[parent] + 1
        levels = []
        for level in range(1, max(depth) + 1):
            joints = np.array([j for j in range(len(self)) if depth[j] == level])
            levels.append((joints, np.array([self.parents[j] for j in joints])))
        return tuple(levels)

    def forward_kinematics(
        self, pose: Array, root: Array, translations: Array | None = None
    ) -> tuple[Array, Array]:
        """World positions (..., J, 3) in metres and world rotations (..., J, 4).

        pose: (..., J, 4) local unit quaternions; root: (..., 3) metres, the root joint's position;
        translations: (..., J, 3) metres where bones change their length, in place of the offsets.
        """
        offsets = self.offsets.astype(pose.dtype) if translations is None else translations
        world = np.array(pose)
        positions = np.empty((*pose.shape[:-1], 3), dtype=pose.dtype)
        positions[..., 0, :] = root
        for joints, parents in self._levels:
            above = world[..., parents, :]
            world[..., joints, :] = quaternion.multiply(above, pose[..., joints, :])
            reach = quaternion.rotate(above, offsets[..., joints, :])
            positions[..., joints, :] = positions[..., parents, :] + reach
        return positions, world


def stance_facts(skeleton: Skeleton) -> dict[str, list[list[float]]]:
    """The stance as plain values, for JSON; empty without one."""
    return {} if skeleton.stance is None else {"stance": np.round(skeleton.stance, 6).tolist()}


def stance_of(facts: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """The stance in plain values. Raises ValueError or TypeError where they are invalid."""
    if facts.get("stance") is None:
        return None
    return np.asarray(facts["stance"], np.float64).reshape(-1, 4)
