"""Melting: the bones of the amorphous body into which a figure melts, as the shader melt.glsl takes them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.body.skinning import BodyMesh, JointNumbers
from appliance.outputs.joint_frame import Floats
from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.projector.picture.poses import Poses

BONES = 15  # melt.glsl's MELT_BONES
GATHERS, SINKS = 0.55, 0.60  # how far a molten body draws together, and how much lower it gets
# Figure heights: how much thicker all bones get, and those near the floor, up to where.
SWELLS, BELOW, UP_TO = 0.03, 0.08, 0.15
END = 0.3  # share of the length of a hand, foot or head: fingers would leave a hole around a longer bone
_NONE = (0.0, 0.0, 0.0, -9.0)  # a bone so thin that nothing is near it


class Melting:
    """Bones are straight and round; each is moved by one joint and stands for the vertices of one part."""

    def __init__(self, mesh: BodyMesh, anatomy: Anatomy) -> None:
        part = _parts(anatomy, mesh.joints[:, 0])
        last = set(part) - {_above(anatomy, part, joint) for joint in np.unique(part)}
        bones = [
            (joint, *_capsule(mesh.vertices[part == joint] / mesh.height, END if joint in last else 1.0))
            for joint in np.unique(part)
        ]
        self._joints = np.array([joint for joint, *_ in bones])
        self._ends = np.array([ends for _, ends, _ in bones])
        self._radii = np.array([radius for *_, radius in bones])
        self.human: dict[str, Any] = {
            "melt_bones": 0,
            "melt_from": BONES * [_NONE],
            "melt_way": BONES * [_NONE],
            "melt_steps": 0,
            "melt_root": (0.0, 0.0, 0.0),
            "melt_gather": (1.0, 1.0, 1.0),
        }
        self._bind = (mesh.bind_positions / mesh.height)[self._joints], mesh.bind_world[self._joints]

    def bones(self, poses: Poses, row: int, melt: float) -> dict[str, Any]:
        """The shader's inputs for a figure in the pose of a row; melt: how amorphous it is."""
        at, world = poses.positions[row, self._joints], poses.world[row, self._joints]
        turn = quaternion.multiply(world, quaternion.inverse(self._bind[1]))
        ends = at[:, None] + quaternion.rotate(turn[:, None], self._ends - self._bind[0][:, None])
        root = poses.positions[row, 0].astype(float)
        gather = 1.0 - np.array([GATHERS, SINKS, GATHERS]) * melt
        ends = gather * (ends - [root[0], 0.0, root[2]]) + [root[0], 0.0, root[2]]
        ways = ends[:, 1] - ends[:, 0]
        radii = self._radii + melt * (SWELLS + BELOW * np.exp(-ends[..., 1].mean(axis=1) / UP_TO))
        none = BONES - len(radii)
        froms = [(*end, radius) for end, radius in zip(ends[:, 0].tolist(), radii.tolist(), strict=True)]
        squares = np.maximum(np.sum(ways**2, axis=1), 1e-6).tolist()
        tos = [(*way, 1.0 / square) for way, square in zip(ways.tolist(), squares, strict=True)]
        return {
            "melt_bones": len(froms),
            "melt_from": froms + none * [_NONE],
            "melt_way": tos + none * [(0.0, 0.0, 0.0, 1.0)],
            "melt_root": tuple(root.tolist()),
            "melt_gather": tuple(gather.tolist()),
        }


def _parts(anatomy: Anatomy, joints: JointNumbers) -> NDArray[np.int64]:
    """(V,): the joint of each vertex's part, of at most BONES parts; joints: (V,) what moves it most.

    Fingers belong to their hand; of too many parts the smallest joins the one that it hangs from."""
    part_of = np.array([anatomy.part_of(joint) for joint in range(len(anatomy.skeleton))])
    part = part_of[joints]
    parents = np.array(anatomy.skeleton.parents)
    while len((found := np.unique(part, return_counts=True))[0]) > BONES:
        hangs = parents[found[0]] >= 0
        smallest = found[0][hangs][found[1][hangs].argmin()]
        part[part == smallest] = part_of[parents[smallest]]
    return part


def _above(anatomy: Anatomy, parts: NDArray[np.int64], joint: int) -> int:
    """The part from which one hangs; -1: it hangs from none."""
    joint = anatomy.skeleton.parents[joint]
    while joint >= 0 and joint not in parts:
        joint = anatomy.skeleton.parents[joint]
    return joint


def _capsule(places: Floats, share: float) -> tuple[Array, float]:
    """The two ends, (2, 3), and the radius of a capsule like these places (V, 3); share: of its length."""
    middle = places.mean(axis=0)
    off = (places - middle).astype(float)
    axis = np.linalg.eigh(off.T @ off)[1][:, -1]
    along = off @ axis
    radius = float(np.sqrt(np.mean(np.sum((off - along[:, None] * axis) ** 2, axis=1))))
    low, high = min(float(along.min()) + radius, 0.0), max(float(along.max()) - radius, 0.0)
    return middle + np.outer([share * low, share * high], axis), radius
