"""Recordings brought into the stage's frame: metres, +Y up, hips as the root, the front to the audience."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from appliance.pose import quaternion
from appliance.pose.body_facts import (
    UPRIGHT,
    floor_m,
    fronts,
    head_way,
    needs_stance,
    rest_positions,
    sampled_positions,
    standing_pose,
    stands,
)
from appliance.pose.bones import span_m
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.roles import places_of
from appliance.pose.skeleton import Skeleton

CENTIMETRE = 0.01  # unit of BVH files, unless no dancer has that size
SMALLEST_M, LARGEST_M, USUAL_M = 1.2, 5.0, 2.3  # from a hand to a foot along the bones: child, giant, dancer
UNITS = {"metres": 1.0, "decimetres": 0.1, "CMU's units": 0.0564, "inches": 0.0254, "centimetres": CENTIMETRE}
UNITS["millimetres"] = 0.001
STILL_DEGREES = 0.1
STRETCH_M = 1e-6
FAR_FROM_HIPS = 0.4  # fraction of the hips' reach, a leg: a root further away is not part of the body
STEADY = 0.8  # length of the mean front: 1 where the dancer never turns
TURNED_DEGREES = 67.5  # a mean front that far from the audience is turned, in quarters
FLOOR_M = 0.15  # a floor further from 0 than this is set to 0; capture leaves it some centimetres off
FACINGS = {"z": 0, "x": 1, "-z": 2, "-x": 3}  # quarter turns about the vertical from the audience
UPS = ("y", "z")


@dataclass(frozen=True)
class FileConventions:
    """Conventions of a file; None: guessed. root: name of the joint that becomes the root; up: 'y' or 'z';
    facing: where the dancer of the file faces once it is upright, a key of FACINGS.
    """

    metres_per_unit: float | None = None
    up: str | None = None
    facing: str | None = None
    root: str | None = None


class Guess(NamedTuple):
    """A change made to a recording, in words, and the option that overrides it ('': asked for)."""

    message: str
    option: str

    def sentence(self) -> str:
        """'turned from Z up to Y up (otherwise: --up y)'."""
        return f"{self.message} (otherwise: {self.option})" if self.option else self.message


AS_GUESSED = FileConventions()


def in_stage_frame(
    recording: Recording, conventions: FileConventions = AS_GUESSED, *, unit_m: float = CENTIMETRE
) -> tuple[Recording, list[Guess]]:
    """The recording in the stage's frame, and what was changed.

    unit_m: of the file's lengths, as it was read. Raises UnknownJointError for a root that it does not have.
    """
    guesses = []
    if conventions.metres_per_unit is None:
        scale, message = _guessed_scale(recording.skeleton, unit_m)
    else:
        scale, message = conventions.metres_per_unit / unit_m, ""
    if scale != 1.0:
        recording = _scaled(recording, scale)
    if message:
        guesses.append(Guess(message, "--metres-per-unit"))
    if not len(recording):
        return recording, guesses
    wanted = conventions.root
    root, why = _root_of(recording) if wanted is None else (recording.skeleton.index(wanted), "")
    if root:
        recording = _rerooted(recording, root)
    if why:
        guesses.append(Guess(why, "--root"))
    if (conventions.up or ("z" if _is_z_up(recording) else "y")) == "z":
        guesses.append(Guess("turned from Z up to Y up", "" if conventions.up else "--up y"))
        recording = _turned_upright(recording)
    recording, message = _faced(recording, conventions.facing)
    if message:
        guesses.append(Guess(message, "" if conventions.facing else "--facing z"))
    floor = floor_m(recording.skeleton, sampled_positions(recording)) if recording.skeleton.feet else 0.0
    if abs(floor) > FLOOR_M:
        recording = replace(recording, roots=recording.roots - np.array([0.0, floor, 0.0]))
        guesses.append(Guess(f"the floor, at a height of {floor:.2f} m in the file, set to 0", ""))
    if needs_stance(recording.skeleton):
        standing = replace(recording.skeleton, stance=standing_pose(recording))
        recording = replace(recording, skeleton=standing)
    return recording, guesses


def _guessed_scale(skeleton: Skeleton, unit_m: float) -> tuple[float, str]:
    """Factor for lengths read in this unit, and a note; 1 if the result is a dancer's size."""
    span = span_m(skeleton)
    if SMALLEST_M <= span <= LARGEST_M or not span:
        return 1.0, ""
    sizes = {unit: span * metres / unit_m for unit, metres in UNITS.items()}
    unit = min(sizes, key=lambda name: abs(np.log(sizes[name] / USUAL_M)))
    if not SMALLEST_M <= sizes[unit] <= LARGEST_M:
        return 1.0, ""
    usual = next(name for name, metres in UNITS.items() if metres == unit_m)
    message = (
        f"lengths read as {unit}: in {usual} there would be {span / unit_m:.2g} of them from hand to foot"
    )
    return UNITS[unit] / unit_m, message


def _scaled(recording: Recording, scale: float) -> Recording:
    skeleton = recording.skeleton
    ends = tuple((joint, (x * scale, y * scale, z * scale)) for joint, (x, y, z) in skeleton.ends)
    return replace(
        recording,
        skeleton=replace(skeleton, offsets=skeleton.offsets * scale, ends=ends),
        roots=recording.roots * scale,
        translations=None if recording.translations is None else recording.translations * scale,
    )


def _root_of(recording: Recording) -> tuple[int, str]:
    """The joint that carries the body, and why it is not the file's root, in words."""
    skeleton = recording.skeleton
    hips = skeleton.roles.get("hips", 0)
    if _hangs_from_nothing(recording):
        return 1, f"{skeleton.names[0]}, which only carries {skeleton.names[1]}, left out"
    if not hips or not set(skeleton.roles.values()) <= set(skeleton.descendants(hips)):
        return 0, ""
    positions = sampled_positions(recording)
    apart = float(np.linalg.norm(positions[:, hips] - positions[:, 0], axis=-1).mean())
    if apart <= FAR_FROM_HIPS * skeleton.reaches[hips]:
        return 0, ""
    kept = {*skeleton.descendants(hips), *skeleton.ancestors(hips)}
    others = [name for joint, name in enumerate(skeleton.names) if joint not in kept]
    besides = f", with {', '.join(others)}" if others else ""
    root, named = skeleton.names[0], skeleton.names[hips]
    return hips, f"{root}, {apart:.2f} m from {named}, left out{besides}: the hips are the root"


def _hangs_from_nothing(recording: Recording) -> bool:
    """Whether the root is not part of the body: it never turns, and its only child, no spine, does."""
    child = places_of(recording.skeleton.names[:2])[-1]
    if child is not None and child.chain == "spine" and child.place:
        return False
    q = recording.poses[:, :2]
    turned = np.degrees(quaternion.angle_between(q, q[:1])).max(axis=0)
    carried = [joint for joint, parent in enumerate(recording.skeleton.parents) if parent == 0]
    return carried == [1] and turned[0] < STILL_DEGREES <= turned[1]


def _rerooted(recording: Recording, root: int) -> Recording:
    """The same motion of a joint and all below it, with that joint as the root."""
    skeleton, translations = recording.skeleton, recording.translations
    kept = skeleton.descendants(root)
    place = {joint: number for number, joint in enumerate(kept)}
    positions, world = skeleton.forward_kinematics(recording.poses, recording.roots, translations)
    poses = recording.poses[:, kept].copy()
    poses[:, 0] = world[:, root]
    offsets = skeleton.offsets[kept].copy()
    offsets[0] = 0.0
    moved = None if translations is None else translations[:, kept]
    if moved is not None and float(np.ptp(moved[:, 1:], axis=0).max(initial=0.0)) < STRETCH_M:
        moved = None
    return Recording(
        Skeleton(
            tuple(skeleton.names[joint] for joint in kept),
            (-1, *(place[skeleton.parents[joint]] for joint in kept[1:])),
            offsets,
            tuple((place[joint], end) for joint, end in skeleton.ends if joint in place),
        ),
        quaternion.continuous(poses),
        positions[:, root].copy(),
        recording.fps,
        moved,
    )


def _is_z_up(recording: Recording) -> bool:
    """Whether the head is above the root along z in the mean of the dance, but not along y at rest."""
    skeleton = recording.skeleton
    rest = head_way(skeleton, rest_positions(skeleton))
    dance = head_way(skeleton, sampled_positions(recording))
    if rest is None or dance is None:
        return False
    return bool(dance[2] > UPRIGHT and abs(dance[1]) < UPRIGHT and abs(rest[1]) < UPRIGHT)


def _turned_upright(recording: Recording) -> Recording:
    """The same motion with z as y; a zero pose that is upright already stays as it is."""
    turn = quaternion.from_axis_angle([1.0, 0.0, 0.0], -np.pi / 2)
    rest = head_way(recording.skeleton, rest_positions(recording.skeleton))
    upright = rest is not None and rest[1] > UPRIGHT
    return _room_turned(recording, turn) if upright else _axes_turned(recording, turn)


def _faced(recording: Recording, facing: str | None) -> tuple[Recording, str]:
    """The recording with the front to +z, at rest and in the mean of the dance, and what was turned.

    Whole quarter turns, so that axes stay axes. facing: of the dance; None: guessed.
    """
    messages, given = [], 0 if facing is None else FACINGS[facing]
    skeleton = recording.skeleton
    rest = rest_positions(skeleton)
    at_rest = _quarters(fronts(skeleton, rest)) if stands(skeleton, rest) else 0
    if at_rest and facing != "z":
        recording = _axes_turned(recording, _quarter_turn(-at_rest))
        messages.append(f"the zero pose, which faces {_side(at_rest)}, turned to the audience")
        given = 0 if facing is None else (given - at_rest) % 4
    if facing is None:
        given = _quarters(fronts(skeleton, sampled_positions(recording)))
        if given:
            messages.append(f"the dance, which mostly faces {_side(given)}, turned to the audience")
    if given and facing != "z":
        recording = _room_turned(recording, _quarter_turn(-given))
        if facing is not None:
            messages.append("turned to the audience")
    return recording, "; ".join(messages)


def _quarters(front: Array | None) -> int:
    """Quarter turns from +z to the mean of fronts (N, 2); 0 where the dancer turns a lot."""
    mean = np.zeros(2) if front is None else front.mean(axis=0)
    degrees = float(np.degrees(np.arctan2(mean[0], mean[1])))
    if float(np.linalg.norm(mean)) < STEADY or abs(degrees) < TURNED_DEGREES:
        return 0
    return round(degrees / 90.0) % 4


def _quarter_turn(quarters: int) -> Array:
    return quaternion.from_axis_angle([0.0, 1.0, 0.0], quarters * np.pi / 2)


def _side(quarters: int) -> str:
    return next(side for side, number in FACINGS.items() if number == quarters)


def _room_turned(recording: Recording, turn: Array) -> Recording:
    """The same motion seen from another side: the zero pose stays, the root turns."""
    poses = recording.poses.copy()
    poses[:, 0] = quaternion.multiply(np.broadcast_to(turn, poses[:, 0].shape), poses[:, 0])
    roots = quaternion.rotate(np.broadcast_to(turn, (len(poses), 4)), recording.roots)
    return replace(recording, poses=quaternion.continuous(poses), roots=roots)


def _axes_turned(recording: Recording, turn: Array) -> Recording:
    """The same motion and the same zero pose turned: the axes of every joint are turned."""

    def turned(vectors: Array) -> Array:
        return quaternion.rotate(np.broadcast_to(turn, (*vectors.shape[:-1], 4)), vectors)

    skeleton, translations = recording.skeleton, recording.translations
    ends = tuple((joint, tuple(turned(np.array(end)).tolist())) for joint, end in skeleton.ends)
    poses = recording.poses.copy()
    poses[..., 1:] = turned(poses[..., 1:])  # a quaternion's axis turns as any vector does
    return replace(
        recording,
        skeleton=replace(skeleton, offsets=turned(skeleton.offsets).astype(np.float64), ends=ends),
        poses=poses,
        roots=turned(recording.roots),
        translations=None if translations is None else turned(translations),
    )
