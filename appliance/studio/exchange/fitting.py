"""A skeleton fitted to tracked points, and its pose in each frame: bone lengths, then inverse kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

_PRIOR = 1e-4  # how much the nearest turn weighs against the children, where these leave a turn open
_ROUNDS = 6  # fits of the shape of several bones at one joint; the third already changes less than 0.1 mm
_TWIST_S = (
    0.1  # standard deviation of the filter of open twists: a bone that points backwards would flip them
)
_TOES = np.array([0.0, -0.2, 0.98])
_TIP = 0.4  # fraction of the last bone: how far the figure reaches beyond a last point


@dataclass(frozen=True)
class Gap:
    """A point that was not seen, frames first to last."""

    joint: int
    first: int
    last: int


def gaps_of(points: Array) -> list[Gap]:
    """Where points (N, J, 3) are not a number."""
    found = []
    for joint in range(points.shape[1]):
        missing = np.concatenate([[False], np.isnan(points[:, joint]).any(axis=1), [False]])
        edges = np.flatnonzero(missing[1:] != missing[:-1])
        found += [Gap(joint, int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return found


def without_gaps(points: Array) -> Array:
    """Points with straight lines over the gaps; at the start and end the nearest place. None is all gap."""
    filled = points.copy()
    frames = np.arange(len(points))
    for joint in {gap.joint for gap in gaps_of(points)}:
        seen = ~np.isnan(points[:, joint]).any(axis=1)
        for axis in range(3):
            filled[:, joint, axis] = np.interp(frames, frames[seen], points[seen, joint, axis])
    return filled


def fit_skeleton(
    names: Sequence[str],
    parents: Sequence[int],
    points: Array,
    directions: Array | None = None,
) -> Skeleton:
    """Bones as long as they mostly are in points (N, J, 3), parents before children, gaps not a number.

    directions: (J, 3) where bones point at rest; left out: as in the first frame that has all the points.
    Several bones at one joint keep the angles that they mostly have.
    """
    lengths = np.concatenate([[0.0], _usual_lengths(points, parents)])
    whole = without_gaps(points)
    stands = directions is not None
    if directions is None:
        first = int(np.argmin(np.isnan(points).any(axis=(1, 2))))
        directions = np.zeros((len(names), 3))
        directions[1:] = whole[first, 1:] - whole[first, list(parents[1:])]
        long = np.linalg.norm(directions, axis=-1, keepdims=True)
        directions = directions / np.where(long > 1e-9, long, 1.0)
    offsets = directions * lengths[:, None]
    children = children_of(parents)
    for joint, below in enumerate(children):
        if len(below) > 1:
            observed = whole[:, below] - whole[:, [joint]]
            offsets[below] = _shape(offsets[below], observed, lengths[below])
    figure = Skeleton(tuple(names), tuple(parents), offsets)
    ends: list[tuple[int, tuple[float, float, float]]] = []
    for joint in range(1, len(names)):
        if not children[joint]:
            x, y, z = _TIP * offsets[joint]
            if stands and joint in figure.feet:  # no point says where the toes are: in front
                x, y, z = _TIP * lengths[joint] * _TOES
            ends.append((joint, (float(x), float(y), float(z))))
    return replace(figure, ends=tuple(ends))


def like(model: Skeleton, points: Array) -> Skeleton:
    """The model with its bones as long as in points (N, J, 3) of the same joints."""
    lengths = _usual_lengths(points, model.parents)
    offsets = np.array(model.offsets, dtype=np.float64)
    own = np.linalg.norm(offsets[1:], axis=-1)
    scale = np.where(own > 1e-9, lengths / np.where(own > 1e-9, own, 1.0), 1.0)
    offsets[1:] *= scale[:, None]
    size = float(np.median(scale)) if len(scale) else 1.0
    ends = tuple((joint, (x * size, y * size, z * size)) for joint, (x, y, z) in model.ends)
    return Skeleton(model.names, model.parents, offsets, ends)


def _usual_lengths(points: Array, parents: Sequence[int]) -> Array:
    """(J - 1,): median lengths of bones in points (N, J, 3), over gaps where no frame has both ends."""

    def lengths(places: Array) -> Array:
        found: Array = np.linalg.norm(places[:, 1:] - places[:, list(parents[1:])], axis=-1)
        return found

    seen = lengths(points)
    if (never := np.isnan(seen).all(axis=0)).any():
        seen[:, never] = lengths(without_gaps(points))[:, never]
    usual: Array = np.nanmedian(seen, axis=0)
    return usual


def children_of(parents: Sequence[int]) -> list[list[int]]:
    """The children of each joint."""
    return [[c for c, parent in enumerate(parents) if parent == joint] for joint in range(len(parents))]


def _shape(rest: Array, observed: Array, lengths: Array) -> Array:
    """Bones (C, 3) with the angles that they mostly have in `observed` (N, C, 3), turned towards `rest`."""
    shape = rest
    weak = np.tile(np.eye(3), (len(observed), 1, 1))
    for _ in range(_ROUNDS):
        turns = _nearest_turns(shape, observed, weak)
        local = np.einsum("nji,ncj->nci", turns, observed)
        mean = np.median(local, axis=0)
        long = np.linalg.norm(mean, axis=-1, keepdims=True)
        shape = np.where(long > 1e-9, mean / np.where(long > 1e-9, long, 1.0), 0.0) * lengths[:, None]
    back = _nearest_turns(shape, rest[None], weak[:1])[0]
    turned: Array = shape @ back.T
    return turned


def _nearest_turns(offsets: Array, observed: Array, prior: Array) -> Array:
    """Rotation matrices (N, 3, 3) that bring bones (C, 3) nearest to `observed` (N, C, 3) (Kabsch 1976).

    Turns that the bones leave open are those of the prior (N, 3, 3).
    """
    size = max(float(np.sum(offsets**2)), 1e-12)
    sums = np.einsum("nci,cj->nij", observed, offsets) + _PRIOR * size * prior
    left, _, right = np.linalg.svd(sums)
    flip = np.ones((len(sums), 3))
    flip[:, 2] = np.sign(np.linalg.det(left @ right))
    turns: Array = (left * flip[:, None]) @ right
    return turns


def _swing(from_: Array, to: Array) -> Array:
    """The shortest turns (N, 4) from directions (N, 3) to others; none where one has no length."""
    a, b = (v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12) for v in (from_, to))
    dot = np.sum(a * b, axis=-1, keepdims=True)
    q = np.concatenate([1.0 + dot, np.cross(a, b)], axis=-1)
    across = np.cross(a, np.eye(3)[np.argmin(np.abs(a), axis=-1)])
    opposite = np.concatenate([np.zeros_like(dot), across], axis=-1)
    return quaternion.normalize(np.where(dot < -1 + 1e-9, opposite, q))


def pose_frames(
    skeleton: Skeleton, points: Array, fps: float, longest_gap_s: float
) -> tuple[Recording, list[Gap]]:
    """The skeleton danced along points (N, J, 3), gaps not a number; the gaps that are too long to be crossed
    in straight lines: there joints turn evenly from the pose before to the pose after.

    Each bone is aimed from where the figure's joint is to where the point was seen, so that differences in
    length do not add up along a limb. With one child bone the twist is
    open, and follows the parent's smoothly; with two or more it is determined.
    """
    too_long = [gap for gap in gaps_of(points) if gap.last - gap.first + 1 > longest_gap_s * fps]
    unseen: NDArray[np.bool_] = np.zeros(points.shape[:2], dtype=bool)
    for gap in too_long:
        unseen[gap.first : gap.last + 1, gap.joint] = True
    whole = without_gaps(points)
    frames, parents = len(points), skeleton.parents
    identity = np.tile(quaternion.IDENTITY.astype(np.float64), (frames, 1))
    poses = np.tile(identity[:, None], (1, len(skeleton), 1))
    world, places = poses.copy(), np.zeros((frames, len(skeleton), 3))
    places[:, 0] = whole[:, 0]
    offsets = np.asarray(skeleton.offsets, dtype=np.float64)
    children = children_of(parents)
    for joint, below in enumerate(children):
        above = identity if parents[joint] < 0 else world[:, parents[joint]]
        if parents[joint] >= 0:
            bone = np.broadcast_to(offsets[joint], (frames, 3))
            places[:, joint] = places[:, parents[joint]] + quaternion.rotate(above, bone)
        aimed = [child for child in below if np.linalg.norm(offsets[child]) > 1e-6]
        if aimed:
            turned = _aim(offsets[aimed], whole[:, aimed] - places[:, [joint]], above)
            local = quaternion.continuous(quaternion.multiply(quaternion.inverse(above), turned))
            if len(aimed) == 1:
                local = _with_smooth_twist(local, offsets[aimed[0]], _TWIST_S * fps)
            poses[:, joint] = _across(local, np.any(unseen[:, aimed], axis=1))
        world[:, joint] = quaternion.multiply(above, poses[:, joint])
    return Recording(skeleton, quaternion.continuous(poses), places[:, 0], fps), too_long


def _aim(bones: Array, observed: Array, above: Array) -> Array:
    """World rotations (N, 4) of a joint with bones (C, 3) that point to `observed` (N, C, 3)."""
    longest = int(np.argmax(np.linalg.norm(bones, axis=-1)))
    now = quaternion.rotate(above, np.broadcast_to(bones[longest], (len(above), 3)))
    swung = quaternion.normalize(quaternion.multiply(_swing(now, observed[:, longest]), above))
    if len(bones) == 1:
        return swung
    return quaternion.from_matrix(_nearest_turns(bones, observed, quaternion.to_matrix(swung)))


def _with_smooth_twist(local: Array, bone: Array, deviation: float) -> Array:
    """Rotations (N, 4) that point the bone where `local` does, with a twist that runs smoothly over frames.

    The twist is what is left of each step beside the shortest turn of the bone; it is summed up, filtered by
    a Gaussian of this many frames, and the difference given back.
    """
    axis = bone / np.linalg.norm(bone)
    points_to = quaternion.rotate(local, np.broadcast_to(axis, (len(local), 3)))
    carried = quaternion.multiply(_swing(points_to[:-1], points_to[1:]), local[:-1])
    left = quaternion.multiply(quaternion.inverse(carried), local[1:])
    steps = 2.0 * np.arctan2(left[:, 1:] @ axis, left[:, 0])
    steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
    twist = np.concatenate([[0.0], np.cumsum(steps)])
    reach = int(np.ceil(3.0 * deviation))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(deviation, 1e-9)) ** 2)
    smooth = np.convolve(np.pad(twist, reach, mode="edge"), kernel / kernel.sum(), mode="valid")
    return quaternion.multiply(local, quaternion.from_axis_angle(axis, smooth - twist))


def _across(local: Array, unseen: NDArray[np.bool_]) -> Array:
    """Rotations (N, 4) that turn evenly over the frames in which nothing was seen."""
    seen = np.flatnonzero(~unseen)
    if not len(seen) or len(seen) == len(local):
        return local
    frames = np.arange(len(local))
    after = np.clip(np.searchsorted(seen, frames), 0, len(seen) - 1)
    before = np.clip(np.searchsorted(seen, frames, side="right") - 1, 0, len(seen) - 1)
    start, end = seen[before], seen[after]
    share = (frames - start) / np.where(end > start, end - start, 1)
    return quaternion.slerp(local[start], local[end], np.clip(share, 0.0, 1.0))
