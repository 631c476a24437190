"""`bunraku retarget`: the same dance on another skeleton, joint by joint of the same role."""

from __future__ import annotations

import numpy as np

from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.roles import missing_roles, places_of
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import t_pose

FLOOR_PERCENTILE = 5.0  # percentile of the lowest sole's heights over the dance


def retarget(dance: Recording, target: Skeleton) -> Recording:
    """The dance of the target's joints: each joint of the same role turns in the world as the dance's does.

    Turns count from a T-pose into which both skeletons are brought, whatever their zero poses are. The hips
    go as far as the legs are long in proportion, and the soles are as high above the floor, at height 0.
    Raises ValueError for a skeleton whose names do not say what its joints are.
    """
    source = dance.skeleton
    for skeleton, label in ((source, "The dance"), (target, "The other skeleton")):
        missing = missing_roles(skeleton.roles)
        if missing:
            raise ValueError(f"{label} has no joint that is known as {', '.join(missing)}.")
    ours, theirs = t_pose(source), t_pose(target)
    positions, world = source.forward_kinematics(dance.poses, dance.roots, dance.translations)
    poses = _turned_alike(world, ours, theirs, _counterparts(source, target))
    scale = leg_m(target) / leg_m(source)
    roots = positions[:, source.roles["hips"]] * scale
    soles = lowest_m(source, positions, world)
    lifts = (soles - np.percentile(soles, FLOOR_PERCENTILE)) * scale
    places, turned = target.forward_kinematics(poses, roots)
    roots[:, 1] += np.maximum(lifts, 0.0) - lowest_m(target, places, turned)
    return Recording(target, quaternion.continuous(poses), roots, dance.fps)


def leg_m(skeleton: Skeleton) -> float:
    """Length of a leg from its hip joint to its ankle, metres; the mean of both."""
    joints = (skeleton.roles[f"{side} {part}"] for side in ("left", "right") for part in ("shin", "foot"))
    return sum(float(np.linalg.norm(skeleton.offsets[joint])) for joint in joints) / 2


def lowest_m(skeleton: Skeleton, positions: Array, world: Array) -> Array:
    """(N,): height of the lowest point of the soles: a joint of the feet, or the end of one."""
    feet = {joint for foot in skeleton.feet for joint in skeleton.descendants(foot)}
    heights = [positions[:, joint, 1] for joint in sorted(feet)]
    for joint, end in skeleton.ends:
        if joint in feet:
            turned = quaternion.rotate(
                world[:, joint], np.broadcast_to(np.array(end), positions[:, joint].shape)
            )
            heights.append(positions[:, joint, 1] + turned[:, 1])
    lowest: Array = np.min(heights, axis=0)
    return lowest


def _counterparts(source: Skeleton, target: Skeleton) -> dict[int, int]:
    """Joint of the target to joint of the source: the same role, else the same finger or eye."""
    found = {joint: source.roles[role] for role, joint in target.roles.items() if role in source.roles}
    by_place = {place: joint for joint, place in reversed(list(enumerate(places_of(source.names)))) if place}
    for joint, place in enumerate(places_of(target.names)):
        if place and place.chain not in ("spine", "arm", "leg") and place in by_place:
            found.setdefault(joint, by_place[place])
    return found


def _turned_alike(world: Array, ours: Anatomy, theirs: Anatomy, counterparts: dict[int, int]) -> Array:
    """Local poses (N, J, 4) of the target; joints without a counterpart stay as they are in its T-pose."""
    target = theirs.skeleton
    still = quaternion.IDENTITY.astype(float)
    turned: Array = np.empty((len(world), len(target), 4))
    local = np.empty_like(turned)
    for joint, parent in enumerate(target.parents):
        above = (
            turned[:, parent] if parent >= 0 else np.tile(quaternion.IDENTITY.astype(float), (len(world), 1))
        )
        if joint in counterparts:
            its = counterparts[joint]
            change = quaternion.multiply(
                world[:, its], np.broadcast_to(quaternion.inverse(ours.world[its]), above.shape)
            )
            turned[:, joint] = quaternion.multiply(change, np.broadcast_to(theirs.world[joint], above.shape))
        else:
            before = still if parent < 0 else theirs.world[parent]
            own = quaternion.multiply(quaternion.inverse(before), theirs.world[joint])
            turned[:, joint] = quaternion.multiply(above, np.broadcast_to(own, above.shape))
        local[:, joint] = quaternion.multiply(quaternion.inverse(above), turned[:, joint])
    return quaternion.normalize(local)
