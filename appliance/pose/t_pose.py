"""The T-pose of any skeleton whose joints are known: what turns of two figures are counted from."""

from __future__ import annotations

import numpy as np

from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

_UP = np.array([0.0, 1.0, 0.0])
_SIDE = np.array([1.0, 0.0, 0.0])
_FOOT = np.array([0.0, -0.35, 1.0])  # from the ankle to the toes
_CURVES_DEGREES = 25.0  # spines curve, arms and feet slope in a zero pose that is a T-pose


def t_pose(skeleton: Skeleton, tolerance_degrees: float = 0.0) -> Anatomy:
    """A skeleton with its spine upright, its arms to the sides, its legs down and its feet to the front.

    A bone that is no further off than the tolerance stays as it is.
    """
    aims: dict[tuple[int, int], Array] = {}
    roles = skeleton.roles

    def aim(start: str, end: str, way: Array) -> None:
        """Each bone from one role to another, even across unnamed joints."""
        joint, first = roles.get(end, -1), roles.get(start, -1)
        chain: dict[tuple[int, int], Array] = {}
        while joint > first >= 0:  # parents come before children
            chain[skeleton.parents[joint], joint] = way
            joint = skeleton.parents[joint]
        if joint == first:
            aims.update(chain)

    for start, end in (("hips", "spine"), ("spine", "chest"), ("chest", "neck"), ("neck", "head")):
        aim(start, end, _UP)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        aim(f"{side} upper arm", f"{side} forearm", sign * _SIDE)
        aim(f"{side} forearm", f"{side} hand", sign * _SIDE)
        aim(f"{side} thigh", f"{side} shin", -_UP)
        aim(f"{side} shin", f"{side} foot", -_UP)
        aim(f"{side} foot", f"{side} toe", _FOOT)
    return Anatomy(skeleton, aimed(Anatomy(skeleton), aims, tolerance_degrees))


def humanoid_rest(skeleton: Skeleton) -> Array:
    """(J, 4): world rotations in the T-pose from which avatars count their turns.

    No turn at all where the zero pose is a T-pose; of one that is another figure, such as an A-pose, only the
    bones that point elsewhere are turned.
    """
    return t_pose(skeleton, _CURVES_DEGREES if skeleton.stance is None else 0.0).world


def aimed(standing: Anatomy, aims: dict[tuple[int, int], Array], tolerance_degrees: float = 0.0) -> Array:
    """Local rotations (J, 4) by which bones point where they should, each turned the shortest way.

    A bone that is no further off than the tolerance stays as it is.
    """
    skeleton = standing.skeleton
    towards = {joint: (child, aim) for (joint, child), aim in aims.items()}
    local = skeleton.standing.copy()
    world = local.copy()
    for joint, parent in enumerate(skeleton.parents):
        above = world[parent] if parent >= 0 else quaternion.IDENTITY.astype(float)
        world[joint] = quaternion.multiply(above, local[joint])
        if joint in towards:
            child, aim = towards[joint]
            bone = quaternion.rotate(world[joint], skeleton.offsets[child])
            turn = shortest_turn(bone, aim)
            if np.degrees(quaternion.angle_between(turn, quaternion.IDENTITY)) > tolerance_degrees:
                world[joint] = quaternion.multiply(turn, world[joint])
        local[joint] = quaternion.multiply(quaternion.inverse(above), world[joint])
    return local


def shortest_turn(start: Array, end: Array) -> Array:
    """The rotation (4,) from one direction to another."""
    a, b = start / max(float(np.linalg.norm(start)), 1e-12), end / np.linalg.norm(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -0.9999:  # the opposite way: about any axis across
        axis = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 0.0, 1.0])
    if float(np.linalg.norm(axis)) < 1e-9:
        return quaternion.IDENTITY.astype(float)
    return quaternion.from_axis_angle(axis, np.arccos(np.clip(cosine, -1.0, 1.0)))
