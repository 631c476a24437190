"""From a video's landmarks to a dance: repaired, fitted to a skeleton, carried by its feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.grounding import Grounding, sole_positions, survey
from appliance.exchange.exchange_error import ExchangeError
from appliance.pose import quaternion
from appliance.pose.point_axes import PointAxes
from appliance.pose.point_fit import TRUNK, PointFit, rest_points
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.roles import missing_roles
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import humanoid_rest, shortest_turn
from appliance.pose.turns import Quaternion, Vector
from appliance.studio.exchange.landmarks_file import LandmarksFile
from appliance.studio.exchange.landmarks_repair import FPS, Repaired, repaired
from appliance.studio.exchange.lifting import lifted

_BONES = {  # a part of the body to the bone that PointFit finds
    "hips": "Hips", "spine": "Spine", "chest": "Chest", "neck": "Neck", "head": "Head",
    **{
        f"{side} {part}": f"{side.capitalize()}{bone}"
        for side in ("left", "right")
        for part, bone in (
            ("collar", "Shoulder"), ("upper arm", "UpperArm"), ("forearm", "LowerArm"), ("hand", "Hand"),
            ("thigh", "UpperLeg"), ("shin", "LowerLeg"), ("foot", "Foot"),
        )
    },
}  # fmt: skip
# Fingers are 6 cm apart, and a network's landmarks tremble by 2: hands that follow the forearm are 18 degrees
# off the truth, those turned as the fingers say 33.
_OF_HANDS = ("index", "little", "thumb", "hand")
_LEAST_TILT, _MOST_TILT = 3.0, 35.0  # degrees; a camera that looks up or down by more gives no figure
_SUPPORT_M = 0.04  # points of the soles this close to the lowest one may carry
_SLIPPED_M = 0.008  # a point that moves this much more in a frame than the others half counts
_ROUNDS = 4
_CARRIED_FRAMES = 9
_CENTRED_M = 0.02
_SHOWN_GAPS = 6


@dataclass(frozen=True)
class FromLandmarks:
    """The dance, and what was done to the landmarks, in lines."""

    recording: Recording
    lines: tuple[str, ...]


def dance_of(
    source: Path, read: LandmarksFile, skeleton: Skeleton, longest_gap_s: float = 0.5, repairs: bool = True
) -> FromLandmarks:
    """The landmarks as a dance of this skeleton, whose bones keep their lengths; 50 poses a second.

    repairs: without it jitter and feet stay as the network has them. Raises ExchangeError.
    """
    if missing := missing_roles(skeleton.roles):
        raise ExchangeError(source, f"The skeleton has no joint that is known as {', '.join(missing)}.")
    parts = read.layout.parts
    _require_trunk(source, parts, read.points)
    even = repaired(parts, read.points, read.seen, read.times, longest_gap_s, smooths=repairs)
    points, path = even.points, None
    fit = PointFit(skeleton)
    if read.is_flat:
        points, path = lifted(parts, points, skeleton)
    turns, points = _turned(read, points, fit, rest_points(skeleton))
    poses = _poses(skeleton, turns)
    roots = _roots(skeleton, poses, parts, points, path, fit)
    dance = Recording(skeleton, quaternion.continuous(poses), roots, FPS)
    if repairs:
        dance = _standing(dance)
    return FromLandmarks(dance, tuple(_lines(read, even, parts)))


def _require_trunk(source: Path, parts: Sequence[str], points: Array) -> None:
    never = [part for part in TRUNK if np.isnan(points[:, parts.index(part), 0]).all()]
    if never:
        raise ExchangeError(source, f"Never seen: {', '.join(never)}. The camera has to see the trunk.")


def _turned(
    read: LandmarksFile, points: Array, fit: PointFit, rest: Mapping[str, Vector]
) -> tuple[dict[str, Array], Array]:
    """Each bone's turns (N, 4) in the room, not numbers where nothing says it; and the points with y up."""
    parts = read.layout.parts
    axes = PointAxes(read.layout.is_y_down and not read.is_flat)
    known = [place for place, part in enumerate(parts) if part and part.rpartition(" ")[2] not in _OF_HANDS]
    upright = points.copy()
    for seconds in (0.0, len(points) / FPS + 10.0):  # once to find the axes, once to use them
        for frame, row in enumerate(points.tolist()):
            seen = {parts[place]: _vector(row[place]) for place in known if row[place][0] == row[place][0]}
            found = axes.turned(seen, seconds + frame / FPS)
            for place in known:
                if parts[place] in found:
                    upright[frame, place] = found[parts[place]]
    upright = _levelled(parts, upright)
    _set_feet_flat(parts, upright, rest)
    turns = {bone: np.full((len(points), 4), np.nan) for bone in _BONES.values()}
    fit.begin()
    for frame, row in enumerate(upright.tolist()):
        seen = {parts[place]: _vector(row[place]) for place in known if row[place][0] == row[place][0]}
        try:
            said: dict[str, Quaternion] = fit.turns(seen)
        except ValueError:  # hips and shoulders in one place: the frames around it say more
            continue
        for bone, turn in said.items():
            if bone in turns:
                turns[bone][frame] = turn
    return {bone: _filled(each) for bone, each in turns.items() if not np.isnan(each).all()}, upright


def _vector(row: Sequence[float]) -> Vector:
    return row[0], row[1], row[2]


def _filled(turns: Array) -> Array:
    """Turns that go evenly over frames that say nothing."""
    known = np.flatnonzero(~np.isnan(turns[:, 0]))
    turns = turns.copy()
    turns[known] = quaternion.continuous(turns[known])
    frames = np.arange(len(turns))
    after = np.clip(np.searchsorted(known, frames), 0, len(known) - 1)
    before = np.clip(np.searchsorted(known, frames, side="right") - 1, 0, len(known) - 1)
    start, end = known[before], known[after]
    share = (frames - start) / np.where(end > start, end - start, 1)
    return quaternion.slerp(turns[start], turns[end], np.clip(share, 0.0, 1.0))


def _levelled(parts: Sequence[str], points: Array) -> Array:
    """Turned so that the body's usual direction from the ankles to the shoulders is up: a phone leans."""
    above, below = (
        np.nanmean(points[:, [parts.index(f"{side} {part}") for side in ("left", "right")]], axis=1)
        for part in ("shoulder", "ankle")
    )
    ways = above - below
    ways = ways[~np.isnan(ways).any(axis=1)]
    if not len(ways):
        return points
    ways /= np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-9)
    up = np.median(ways, axis=0)
    turn = shortest_turn(up, np.array([0.0, 1.0, 0.0]))
    tilt = float(np.degrees(quaternion.angle_between(turn, quaternion.IDENTITY)))
    if not _LEAST_TILT < tilt < _MOST_TILT:
        return points
    return quaternion.rotate(np.broadcast_to(turn, (*points.shape[:2], 4)), points)


def _set_feet_flat(parts: Sequence[str], points: Array, rest: Mapping[str, Vector]) -> None:
    """Toes raised or lowered so that feet that carry slope as the figure's do: networks have them steeper."""
    sides = [side for side in ("left", "right") if f"{side} toe" in parts]
    ankles = {side: points[:, parts.index(f"{side} ankle")] for side in sides}
    for side in sides:
        toes = points[:, parts.index(f"{side} toe")]
        low = ankles[side][:, 1] <= np.min([ankles[one][:, 1] for one in sides], axis=0)
        long = np.linalg.norm(toes - ankles[side], axis=-1)
        figure = np.subtract(rest[f"{side} toe"], rest[f"{side} ankle"])
        slope = np.median(((toes - ankles[side])[:, 1] / np.maximum(long, 1e-9))[low]) if low.any() else 0.0
        toes[:, 1] += (figure[1] / np.linalg.norm(figure) - slope) * long


def _poses(skeleton: Skeleton, turns: dict[str, Array]) -> Array:
    """(N, J, 4) local rotations; a joint that no bone turns goes with the one above it."""
    rest = humanoid_rest(skeleton)
    frames = len(next(iter(turns.values())))
    bone_of = {joint: _BONES[role] for role, joint in skeleton.roles.items() if role in _BONES}
    if "chest" not in skeleton.roles and "spine" in skeleton.roles:
        bone_of[skeleton.roles["spine"]] = "Chest"  # the arms start there
    still = np.tile(quaternion.IDENTITY.astype(float), (frames, 1))
    turned: list[Array] = []
    poses = np.empty((frames, len(skeleton), 4))
    for joint, parent in enumerate(skeleton.parents):
        above = turned[parent] if parent >= 0 else still
        turned.append(turns.get(bone_of.get(joint, ""), above))
        own = quaternion.multiply(turned[joint], np.broadcast_to(rest[joint], (frames, 4)))
        over = still if parent < 0 else quaternion.multiply(above, np.broadcast_to(rest[parent], (frames, 4)))
        poses[:, joint] = quaternion.multiply(quaternion.inverse(over), own)
    return quaternion.normalize(poses)


def _roots(
    skeleton: Skeleton,
    poses: Array,
    parts: Sequence[str],
    points: Array,
    path: Array | None,
    fit: PointFit,
) -> Array:
    """(N, 3): from the points where they are places in a room; else as the feet carry the figure.

    path (N,): metres to the side, as the picture says them.
    """
    hips = points[:, [parts.index("left hip"), parts.index("right hip")]].mean(axis=1)
    roots = np.zeros((len(poses), 3))
    is_centred = path is None and float(np.abs(hips).max()) < _CENTRED_M
    if not is_centred and path is None:
        sizes = [fit.scale(_named(parts, row)) for row in points[:: max(1, len(points) // 100)].tolist()]
        roots = float(np.median([size for size in sizes if size])) * hips
    soles = sole_positions(skeleton, poses, roots)
    roots[:, 1] -= soles[..., 1].min(axis=1) - (0.0 if is_centred or path is not None else soles.min())
    if is_centred or path is not None:
        roots[:, [0, 2]] = _carried(soles)
    if path is not None:
        roots[:, 0] = path
    roots[:, [0, 2]] -= roots[0, [0, 2]]
    return roots


def _named(parts: Sequence[str], row: list[list[float]]) -> dict[str, Vector]:
    return {part: _vector(one) for part, one in zip(parts, row, strict=True) if part and one[0] == one[0]}


def _carried(soles: Array) -> Array:
    """(N, 2): the way over the floor on which the points of the soles (N, S, 3) that carry stay in place.

    The lowest points carry; of those the ones that move alike, and not one that swings just above the floor.
    """
    steps = np.diff(soles[..., [0, 2]], axis=0)
    heights = (soles[1:, :, 1] + soles[:-1, :, 1]) / 2
    low = np.clip(1.0 - (heights - heights.min(axis=1, keepdims=True)) / _SUPPORT_M, 0.0, 1.0) ** 2
    weight, moved = low, np.zeros((len(steps), 2))
    for _ in range(_ROUNDS):
        moved = (weight[..., None] * steps).sum(axis=1) / weight.sum(axis=1)[:, None]
        apart = np.linalg.norm(steps - moved[:, None], axis=-1)
        weight = low / (1.0 + (apart / _SLIPPED_M) ** 2) + 1e-9
    way: Array = np.concatenate([np.zeros((1, 2)), np.cumsum(-_eased(moved), axis=0)])
    return way


def _eased(values: Array) -> Array:
    """Hann-weighted mean over frames, the ends held."""
    weights = np.hanning(_CARRIED_FRAMES + 2)[1:-1]
    padded = np.pad(values, ((_CARRIED_FRAMES // 2,) * 2, (0, 0)), mode="edge")
    columns = [np.convolve(padded[:, axis], weights / weights.sum(), mode="valid") for axis in (0, 1)]
    return np.stack(columns, axis=-1)


def _standing(dance: Recording) -> Recording:
    """Feet locked where they carry, and the lowest one on the floor, as the stage stands a figure."""
    floor = survey(dance)
    grounding = Grounding(dance.skeleton, floor)
    free: NDArray[np.float32] = np.zeros(len(dance.skeleton), dtype=np.float32)
    poses, roots = dance.poses.astype(np.float32), dance.roots.astype(np.float32)
    for frame in range(len(dance)):
        grounding.ground_pose(poses[frame], roots[frame], float(floor.lifts[frame]), None, free)
        poses[frame], roots[frame] = grounding.pose, grounding.root
    return replace(dance, poses=quaternion.continuous(poses.astype(float)), roots=roots.astype(float))


def _lines(read: LandmarksFile, even: Repaired, parts: Sequence[str]) -> list[str]:
    steps = np.diff(read.times)
    rate = 1.0 / float(np.median(steps)) if len(steps) else FPS
    unseen = int(np.isnan(read.points[:, parts.index(TRUNK[2]), 0]).sum())
    lines = [
        f"{read.layout.program}: {len(read.times)} frames, {rate:.1f} a second, brought to {FPS:g} even ones",
        *([f"frame times differ by up to {1000 * np.ptp(steps):.0f} ms"] if np.ptp(steps) > 0.002 else []),
        *read.notes,
        *([f"nobody seen in {unseen} frames"] if unseen else []),
        *([f"left and right put back in {even.swapped} frames"] if even.swapped else []),
        *([f"{even.leaps} leaps of landmarks left out"] if even.leaps else []),
    ]
    for place, first, last in even.gaps[:_SHOWN_GAPS]:
        lines.append(
            f"{parts[place]} not seen from {first:.1f} to {last:.1f} s: look whether it can be danced"
        )
    if len(even.gaps) > _SHOWN_GAPS:
        lines.append(f"and {len(even.gaps) - _SHOWN_GAPS} more such gaps")
    return lines
