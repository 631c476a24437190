"""Recordings brought into the stage's frame: metres, +Y up, the joint that carries the body as the root."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.data.bones import span_m

CENTIMETRE = 0.01  # unit of BVH files, unless no dancer has that size
SMALLEST_M, LARGEST_M, USUAL_M = 1.2, 5.0, 2.3  # from a hand to a foot along the bones: child, giant, dancer
UNITS = {"metres": 1.0, "decimetres": 0.1, "CMU's units": 0.0564, "inches": 0.0254, "millimetres": 0.001}
STILL_DEGREES = 0.1
UPRIGHT = 0.6  # of the way from root to head lies along the vertical, in the mean of a recording


def in_stage_frame(recording: Recording, metres_per_unit: float | None = None) -> tuple[Recording, list[str]]:
    """The recording in the stage's frame, and notes for people on what was changed.

    recording: as read from a file in centimetres; metres_per_unit: unit of its lengths, if known.
    """
    notes = []
    if metres_per_unit is None:
        scale, words = _guessed_scale(recording.skeleton)
    else:
        scale, words = metres_per_unit / CENTIMETRE, ""
    if scale != 1.0:
        recording = _scaled(recording, scale)
    if words:
        notes.append(words)
    if len(recording) and _hangs_from_nothing(recording):
        notes.append(
            f"{recording.skeleton.names[0]}, which only carries {recording.skeleton.names[1]}, left out"
        )
        recording = _without_root(recording)
    if len(recording) and _is_z_up(recording):
        notes.append("turned from Z up to Y up")
        recording = _turned_upright(recording)
    return recording, notes


def _guessed_scale(skeleton: Skeleton) -> tuple[float, str]:
    """Factor for lengths read as centimetres, and a note; 1 if the result is a dancer's size."""
    span = span_m(skeleton)
    if SMALLEST_M <= span <= LARGEST_M or not span:
        return 1.0, ""
    sizes = {unit: span * metres / CENTIMETRE for unit, metres in UNITS.items()}
    unit = min(sizes, key=lambda name: abs(np.log(sizes[name] / USUAL_M)))
    if not SMALLEST_M <= sizes[unit] <= LARGEST_M:
        return 1.0, ""
    words = (
        f"lengths read as {unit}: in centimetres there would be {100 * span:.2g} of them from hand to foot"
    )
    return UNITS[unit] / CENTIMETRE, words


def _scaled(recording: Recording, scale: float) -> Recording:
    skeleton = recording.skeleton
    ends = tuple((joint, (x * scale, y * scale, z * scale)) for joint, (x, y, z) in skeleton.ends)
    return replace(
        recording,
        skeleton=replace(skeleton, offsets=skeleton.offsets * scale, ends=ends),
        roots=recording.roots * scale,
        translations=None if recording.translations is None else recording.translations * scale,
    )


def _hangs_from_nothing(recording: Recording) -> bool:
    """Whether the root is not part of the body: it never turns, and its only child does."""
    q = recording.poses[:, :2]
    turned = np.degrees(quaternion.angle_between(q, q[:1])).max(axis=0)
    carried = [joint for joint, parent in enumerate(recording.skeleton.parents) if parent == 0]
    return carried == [1] and turned[0] < STILL_DEGREES <= turned[1]


def _without_root(recording: Recording) -> Recording:
    """The same motion with the root's only child as the root."""
    skeleton = recording.skeleton
    translations = recording.translations
    offset = skeleton.offsets[1] if translations is None else translations[:, 1]
    turn = recording.poses[:, 0]
    poses = recording.poses[:, 1:].copy()
    poses[:, 0] = quaternion.multiply(turn, poses[:, 0])
    offsets = skeleton.offsets[1:].copy()
    offsets[0] = 0.0
    return Recording(
        Skeleton(
            skeleton.names[1:],
            tuple(parent - 1 for parent in skeleton.parents[1:]),
            offsets,
            tuple((joint - 1, end) for joint, end in skeleton.ends if joint),
        ),
        quaternion.continuous(poses),
        recording.roots + quaternion.rotate(turn, np.broadcast_to(offset, recording.roots.shape)),
        recording.fps,
        None if translations is None else translations[:, 1:],
    )


def _is_z_up(recording: Recording) -> bool:
    """Whether the head is above the root along z, at rest and in the mean of the dance."""
    skeleton = recording.skeleton
    head = skeleton.head
    if not head:
        return False
    rest = np.tile(quaternion.IDENTITY.astype(float), (1, len(skeleton), 1))
    ways = []
    for poses in (rest, recording.poses[:: max(1, round(recording.fps / 5))]):
        places, _ = skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
        way = places[:, head] / np.linalg.norm(places[:, head], axis=-1, keepdims=True)
        ways.append(way.mean(axis=0))
    return all(way[2] > UPRIGHT and abs(way[1]) < UPRIGHT for way in ways)


def _turned_upright(recording: Recording) -> Recording:
    """The same motion and the same rest pose with z as y: the axes of every joint are turned."""
    turn = quaternion.from_axis_angle([1.0, 0.0, 0.0], -np.pi / 2)

    def upright(vectors: Array) -> Array:
        return quaternion.rotate(np.broadcast_to(turn, (*vectors.shape[:-1], 4)), vectors)

    skeleton, translations = recording.skeleton, recording.translations
    ends = tuple((joint, tuple(upright(np.array(end)).tolist())) for joint, end in skeleton.ends)
    poses = recording.poses.copy()
    poses[..., 1:] = upright(poses[..., 1:])  # a quaternion's axis turns as any vector does
    return replace(
        recording,
        skeleton=replace(skeleton, offsets=upright(skeleton.offsets).astype(np.float64), ends=ends),
        poses=poses,
        roots=upright(recording.roots),
        translations=None if translations is None else upright(translations),
    )
