"""A stretch of dance in few numbers, and the distance between two sets of stretches.

Kinetic features after Onuma et al. 2008 and geometric ones after Mueller et al. 2005, as AIST++ uses them
(Li et al. 2021, features/kinetic.py and manual.py, from fairmotion), written anew: at the true rate (AIST++
takes 120 poses a second throughout), thresholds by the body's own bones (there SMPL's), joints by parts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

CLIP_S, EVERY_S = 2.0, 0.5
SMOOTH = 2  # poses on either side of one whose velocity is averaged, as in AIST++
LEAST_CLIPS = 8
_PARTS = ("upper arm", "forearm", "hand", "thigh", "shin", "foot")
ROLES = (
    "hips",
    "chest",
    "neck",
    "head",
    *(f"{side} {part}" for side in ("left", "right") for part in _PARTS),
)
Relation = NDArray[np.bool_]
Clips = NDArray[np.float64]


def clip_begins(count: int, fps: float) -> range:
    """Where clips of CLIP_S begin in `count` poses, one each EVERY_S."""
    return range(0, count - round(CLIP_S * fps) + 1, round(EVERY_S * fps))


def clips_of(positions: Array, fps: float) -> list[Array]:
    """Those clips of positions (T, J, 3)."""
    length = round(CLIP_S * fps)
    return [positions[begin : begin + length] for begin in clip_begins(len(positions), fps)]


def kinetic_features(skeleton: Skeleton, clips: Sequence[Array], fps: float) -> Clips:
    """(N, 3 R): of each of ROLES horizontal and vertical energy and mean acceleration.

    Energies are half squares of velocities: every mass is 1. clips: positions (T, J, 3), metres.
    """
    places = [skeleton.roles[role] for role in ROLES if role in skeleton.roles]
    found = []
    for clip in clips:
        points = clip[:, places].astype(np.float64)
        velocities = (points[2 * SMOOTH :] - points[: -2 * SMOOTH]) * fps / (2 * SMOOTH)
        accelerations = np.diff(velocities, axis=0) * fps
        across = (velocities[..., [0, 2]] ** 2).sum(axis=-1).mean(axis=0) / 2
        upwards = (velocities[..., 1] ** 2).mean(axis=0) / 2
        found.append([across, upwards, np.linalg.norm(accelerations, axis=-1).mean(axis=0)])
    return np.array(found, dtype=np.float64).reshape(len(clips), 3 * len(places))


def geometric_features(skeleton: Skeleton, clips: Sequence[Array], fps: float) -> Clips | None:
    """(N, 32): in which share of its poses a clip fulfils each of 32 relations of limbs.

    None for a body whose parts have no names. clips: positions (T, J, 3), metres.
    """
    if any(role not in skeleton.roles for role in (*ROLES, "spine")):
        return None
    return np.array([_relations(skeleton, clip.astype(np.float64), fps) for clip in clips]).reshape(-1, 32)


def frechet_distance(made: Clips, known: Clips) -> float:
    """Between Gaussians that fit two sets of features (N, D), in standard deviations of the known (FID).

    Heusel et al. 2017; NaN for fewer than LEAST_CLIPS.
    """
    if min(len(made), len(known)) < LEAST_CLIPS:
        return float("nan")
    mean, deviation = known.mean(axis=0), known.std(axis=0)
    moves = deviation > 1e-9
    a, b = ((part[:, moves] - mean[moves]) / deviation[moves] for part in (made, known))
    of_a, of_b = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    values, vectors = np.linalg.eigh(np.atleast_2d(of_a))
    root = (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T
    shared = np.sqrt(np.maximum(np.linalg.eigvalsh(root @ np.atleast_2d(of_b) @ root), 0)).sum()
    apart = ((a.mean(axis=0) - b.mean(axis=0)) ** 2).sum()
    return float(apart + np.trace(np.atleast_2d(of_a)) + np.trace(np.atleast_2d(of_b)) - 2 * shared)


def _relations(skeleton: Skeleton, clip: Array, fps: float) -> list[float]:
    """The 32 relations of one clip; lengths in upper arms, shoulder widths and hip widths of this body."""
    at = {role: clip[1:, joint] for role, joint in skeleton.roles.items()}
    before = {role: clip[:-1, joint] for role, joint in skeleton.roles.items()}
    arm = float(np.linalg.norm(skeleton.offsets[skeleton.roles["right forearm"]]))
    hips = float(np.linalg.norm(at["left thigh"][0] - at["right thigh"][0]))
    shoulders = float(np.linalg.norm(at["left upper arm"] - at["right upper arm"], axis=-1).mean())
    up, lowest = np.array([0.0, 1.0, 0.0]), clip[1:, :, 1].min(axis=1)
    pace = {role: (at[role] - before[role]) * fps for role in at}

    def along(direction: Array, role: str, base: str, least: float) -> Relation:
        """Whether a part moves along a direction, against its base, at a least speed."""
        return np.asarray(_dot(pace[role] - pace[base], _unit(direction)) > least)

    def fast(role: str, least: float) -> Relation:
        quick: Relation = np.linalg.norm(pace[role], axis=-1) > least
        return quick

    def bent(role: str, over: str, to: str) -> Relation:
        return np.asarray(_degrees(at[over] - at[role], at[to] - at[role]) < 110)

    def raised(start: str, end: str, least: float) -> Relation:
        return np.asarray(_degrees(at["hips"] - at["neck"], at[end] - at[start]) > least)

    def in_front(first: str, second: str, third: str, role: str, least: float) -> Relation:
        """Whether a part is so far in front of the plane through three others."""
        normal = np.cross(at[second] - at[first], at[third] - at[first])
        return np.asarray(_dot(at[role] - at[first], _unit(normal)) > least)

    chest, spine = at["neck"] - at["chest"], at["chest"] - at["spine"]
    across, hip_line = (at[f"right {part}"] - at[f"left {part}"] for part in ("upper arm", "thigh"))
    apart = at["left hand"] - at["right hand"]
    found: list[Relation] = [np.abs(_degrees(at["neck"] - at["hips"], up) - 90) < 20, fast("hips", 2.3 * arm)]
    found += [along(-apart, "left hand", "right hand", 1.4 * arm)]
    found += [_dot(at["right hand"] - at["left hand"], _unit(across)) > 2.5 * shoulders]
    found += [_dot(at["right foot"] - at["left foot"], _unit(hip_line)) > 2.1 * hips]
    found += [in_front("right foot", "neck", "left foot", "hips", 0.5 * arm)]
    for side, other in (("right", "left"), ("left", "right")):
        hand, elbow, shoulder = f"{side} hand", f"{side} forearm", f"{side} upper arm"
        foot, knee, hip = f"{side} foot", f"{side} shin", f"{side} thigh"
        plane = np.cross(at[hip] - at["neck"], at[f"{other} thigh"] - at["neck"])
        found += [
            along(plane, hand, "neck", 1.8 * arm),
            _dot(at[hand] - at["neck"], _unit(chest)) > 0.2 * arm,
            along(spine, hand, "chest", 1.8 * arm),
            bent(elbow, shoulder, hand),
            along(at["hips"] - at[hand], hand, "hips", 1.4 * arm),
            fast(hand, 2.5 * arm),
            in_front("hips", f"{other} thigh", f"{other} foot", foot, 0.38 * arm),
            at[foot][:, 1] - lowest > 1.2 * arm,
            bent(knee, hip, foot),
            fast(foot, 2.5 * arm),
            raised(shoulder, elbow, 25),
            raised(hip, knee, 50),
            at[hand][:, 1] - lowest < 1.2 * arm,
        ]
    return [float(np.mean(relation)) for relation in found]


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=-1)
    return product


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return unit


def _degrees(a: Array, b: Array) -> Array:
    degrees: Array = np.degrees(np.arccos(np.clip(_dot(_unit(a), _unit(b)), -1, 1)))
    return degrees
