"""The dancer's facts from a recording: height, floor, the head's place, the front."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

SMALLEST_M, TALLEST_M = 1.2, 2.2  # a body outside is asked about
UPRIGHT = 0.6  # fraction of the way from hips to head that is along an axis
SAMPLES_A_SECOND = 5.0
STANDING_PERCENTILE = 90.0  # percentile of the heights, sole to crown: upright in a tenth of the time
HANGING_SHARE = 0.5  # metres of height that a metre of lower hands is worth in a standing pose
LIMB_ENDS = ("neck", "head", "hand", "foot", "toe")
PLANTED_PERCENTILE = 5.0  # percentile of the heights of the lowest sole: the floor


def sampled_positions(recording: Recording) -> Array:
    """World positions (N, J, 3) in metres, five instants a second."""
    every = slice(None, None, max(1, round(recording.fps / SAMPLES_A_SECOND)))
    moved = None if recording.translations is None else recording.translations[every]
    return recording.skeleton.forward_kinematics(recording.poses[every], recording.roots[every], moved)[0]


def rest_positions(skeleton: Skeleton) -> Array:
    """(1, J, 3): where the joints are in the zero pose."""
    rest = np.tile(quaternion.IDENTITY.astype(float), (1, len(skeleton), 1))
    return skeleton.forward_kinematics(rest, np.zeros((1, 3)))[0]


def head_way(skeleton: Skeleton, positions: Array) -> Array | None:
    """(3,): mean direction from the root to the head, of positions (N, J, 3); None without a head."""
    head = skeleton.head
    if not head:
        return None
    ways = positions[:, head] - positions[:, 0]
    way: Array = (ways / np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-12)).mean(axis=0)
    return way


def fronts(skeleton: Skeleton, positions: Array) -> Array | None:
    """(N, 2): unit vectors along x and z to the dancer's front; None where no name says the sides."""
    across = np.zeros((len(positions), 3))
    for part in ("thigh", "upper arm"):
        sides = [skeleton.roles.get(f"{side} {part}") for side in ("left", "right")]
        if None not in sides:
            across = across + positions[:, sides[0]] - positions[:, sides[1]]
    front = np.stack([-across[:, 2], across[:, 0]], axis=-1)  # across x (0, 1, 0), its x and z
    lengths = np.linalg.norm(front, axis=-1, keepdims=True)
    return front / np.maximum(lengths, 1e-12) if (lengths > 1e-6).any() else None


def stands(skeleton: Skeleton, positions: Array) -> bool:
    """Whether the head is above the root and the feet are below it: a zero pose that is a figure."""
    way, feet = head_way(skeleton, positions), list(skeleton.feet)
    if way is None or not feet:
        return False
    below = positions[:, 0, 1] - positions[:, feet, 1].mean(axis=-1)
    return bool(way[1] > UPRIGHT and (below > 0.2 * skeleton.reaches[0]).all())


def needs_stance(skeleton: Skeleton) -> bool:
    """Whether the zero pose of a skeleton with head and feet is no figure."""
    known = skeleton.head is not None and bool(skeleton.feet)
    return known and not stands(skeleton, rest_positions(skeleton))


def with_stance(recording: Recording) -> Skeleton:
    """The skeleton of a bundle's skeleton.bvh, whose pose is the stance where the zero pose is no figure."""
    skeleton = recording.skeleton
    if not needs_stance(skeleton) or not len(recording):
        return skeleton
    return replace(skeleton, stance=recording.poses[0].astype(np.float64))


def standing_pose(recording: Recording) -> NDArray[np.float64]:
    """(J, 4): the recorded pose that stands tallest with the lowest hands, turned to the front.

    Neck, head, hands and feet as they mostly are: a look aside at that moment is no part of the body.
    """
    skeleton = recording.skeleton
    every = max(1, round(recording.fps / SAMPLES_A_SECOND))
    positions = sampled_positions(recording)
    head = skeleton.head or 0
    tall = positions[:, head, 1] - lowest_soles(skeleton, positions)
    hands = [joint for role, joint in skeleton.roles.items() if role.endswith(" hand")]
    low = positions[:, hands, 1].mean(axis=-1) - positions[:, 0, 1] if hands else np.zeros(len(tall))
    best = int(np.argmax(tall - HANGING_SHARE * low))
    pose: NDArray[np.float64] = recording.poses[best * every].astype(np.float64).copy()
    for role, joint in skeleton.roles.items():
        if role.rpartition(" ")[2] in LIMB_ENDS:
            pose[joint] = quaternion.blend(recording.poses[::every, joint], np.ones(len(positions)))
    front = fronts(skeleton, positions[best : best + 1])
    if front is not None:
        turn = quaternion.from_axis_angle([0.0, 1.0, 0.0], -np.arctan2(front[0, 0], front[0, 1]))
        pose[0] = quaternion.multiply(turn, pose[0])
    return pose


def lowest_soles(skeleton: Skeleton, positions: Array) -> Array:
    """(N,): height in metres of the lowest joint of the feet or below; without feet of the lowest joint."""
    feet = sorted({joint for foot in skeleton.feet for joint in skeleton.descendants(foot)})
    heights = positions[:, feet or range(len(skeleton)), 1]
    lowest: Array = heights.min(axis=-1)
    return lowest


def floor_m(skeleton: Skeleton, positions: Array) -> float:
    """Height of the floor, from where the lowest sole mostly is."""
    return float(np.percentile(lowest_soles(skeleton, positions), PLANTED_PERCENTILE))


def height_m(skeleton: Skeleton, positions: Array) -> float:
    """Height of the standing dancer from the soles to the crown, metres."""
    head = skeleton.head
    top = positions[..., 1].max(axis=-1) if head is None else positions[:, head, 1]
    crown = max((float(np.linalg.norm(end)) for joint, end in skeleton.ends if joint == head), default=0.0)
    tall = float(np.percentile(top - lowest_soles(skeleton, positions), STANDING_PERCENTILE))
    return tall + (crown or 0.12 * tall)
