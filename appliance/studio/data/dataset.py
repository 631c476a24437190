"""Training data: recordings to windows of poses, split by take, capture errors masked, mirrored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bvh import leading_tpose_frames, read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.data.capture_errors import CaptureError, find_capture_errors, sound_frames
from appliance.studio.data.catalogue import CATALOGUES, Catalogue, find_catalogue, read_catalogue

__all__ = [
    "CATALOGUES",
    "CaptureError",
    "Catalogue",
    "Dataset",
    "DatasetError",
    "Take",
    "extremities",
    "find_catalogue",
    "load_dataset",
    "load_take",
    "mean_pose",
    "mirror_pairs",
    "mirrored",
    "moving_joints",
    "read_catalogue",
    "window_starts",
    "windows",
]

FPS = 50.0
WINDOW = 8
MOVING_DEGREES = 1.0  # joints that turn less than this in every recording are still
TPOSE_FRAMES = 3
Pose = NDArray[np.floating[Any]]


class DatasetError(ValueError):
    """Recordings that cannot be trained on; says which and why."""


@dataclass(frozen=True)
class Take:
    """One recording at 50 Hz with what is known of it."""

    name: str
    take: str
    recording: Recording
    sound: NDArray[np.bool_]  # (N,) frames that are no glitch
    header_fps: float
    true_fps: float
    errors: tuple[CaptureError, ...] = ()  # why the others are


@dataclass(frozen=True)
class Dataset:
    """Takes with one skeleton; which joints move; which takes are kept apart."""

    skeleton: Skeleton
    moving: tuple[int, ...]
    training: tuple[Take, ...]
    held_out: tuple[Take, ...]

    @property
    def moving_names(self) -> tuple[str, ...]:
        return tuple(self.skeleton.names[j] for j in self.moving)

    def still_pose(self) -> NDArray[np.float64]:
        """(J, 4): the mean pose of the training takes, in which the still joints stand for good."""
        return mean_pose(self.training)


def load_dataset(
    folder: Path,
    catalogue: Catalogue | None = None,
    progress: Callable[[Sequence[Path]], Sequence[Path]] = lambda files: files,
) -> Dataset:
    """Read every BVH file of a folder. Raises DatasetError where skeletons differ or nothing is left."""
    files = sorted(folder.glob("*.bvh"))
    if not files:
        raise DatasetError(f"{folder} has no .bvh files. Give the folder that holds your recordings.")
    catalogue = catalogue or find_catalogue(folder, files)
    read = [_read(file, catalogue) for file in progress(files)]
    takes = [take for take, _ in read]
    skeleton = takes[0].recording.skeleton
    for file, take in zip(files, takes, strict=True):
        if not take.recording.skeleton.same_joints(skeleton):
            raise DatasetError(
                f"{file.name} has another skeleton than {files[0].name}. Train one dancer on one skeleton: "
                "move the file to a folder of its own."
            )
    held = {take.take for take in takes if catalogue.is_held_out(take.name)}
    if not held and len({take.take for take in takes}) > 1:
        held = {sorted({take.take for take in takes})[-1]}
    if all(take.take in held for take in takes):
        raise DatasetError("Every take is held out: nothing is left to train on.")
    moving = moving_joints(takes)
    errors = find_capture_errors([recorded for _, recorded in read], moving)
    takes = [_masked(take, found) for take, found in zip(takes, errors, strict=True)]
    training = tuple(take for take in takes if take.take not in held)
    return Dataset(skeleton, moving, training, tuple(take for take in takes if take.take in held))


def load_take(file: Path, catalogue: Catalogue, usual: Mapping[str, Pose] | None = None) -> Take:
    """One file at its true rate, T-pose dropped, capture errors marked, resampled to 50 Hz.

    usual: by joint name the orientations (4,) in which the dancer usually is, where one file cannot tell.
    """
    take, recorded = _read(file, catalogue)
    skeleton = recorded.skeleton
    known = {skeleton.index(name): pose for name, pose in (usual or {}).items() if name in skeleton.names}
    return _masked(take, find_capture_errors([recorded], moving_joints([take]), known)[0])


def _read(file: Path, catalogue: Catalogue) -> tuple[Take, Recording]:
    """A take in which nothing is masked, and its recording at the rate at which it was captured."""
    header = read_bvh(file)
    fps = catalogue.fps_of(file.stem) or header.fps
    recording = replace(header, fps=fps)
    if leading_tpose_frames(recording):
        recording = recording.without_first(TPOSE_FRAMES)
    resampled = recording.resampled(FPS)
    sound = np.ones(len(resampled), dtype=bool)
    return Take(file.stem, catalogue.take_of(file.stem), resampled, sound, header.fps, fps), recording


def _masked(take: Take, errors: Sequence[CaptureError]) -> Take:
    return replace(take, sound=sound_frames(len(take.recording), FPS, errors), errors=tuple(errors))


def mean_pose(takes: Sequence[Take]) -> NDArray[np.float64]:
    """(J, 4): mean of the sound poses, their heading removed."""
    poses = np.concatenate([take.recording.poses[take.sound] for take in takes])
    facing = quaternion.heading(poses[:, :1])
    poses = np.concatenate([quaternion.multiply(quaternion.inverse(facing), poses[:, :1]), poses[:, 1:]], 1)
    mean = quaternion.aligned(poses, poses[len(poses) // 2]).mean(axis=0)
    return quaternion.normalize(mean).astype(np.float64)


def extremities(skeleton: Skeleton, moving: Sequence[int]) -> list[int]:
    """Moving joints with no moving joint below them: head, hands, feet."""
    inner: set[int] = set()
    for joint in moving:
        while (joint := skeleton.parents[joint]) >= 0:
            inner.add(joint)
    return [joint for joint in moving if joint not in inner]


def moving_joints(takes: Sequence[Take]) -> tuple[int, ...]:
    """Joints that turn more than a degree in any recording."""
    count = len(takes[0].recording.skeleton)
    widest = np.zeros(count)
    for take in takes:
        poses = take.recording.poses
        widest = np.maximum(widest, np.degrees(quaternion.angle_between(poses, poses[:1])).max(axis=0))
    return tuple(int(j) for j in np.flatnonzero(widest > MOVING_DEGREES))


def mirror_pairs(skeleton: Skeleton) -> NDArray[np.intp]:
    """(J,): for each joint its counterpart on the other side (itself for the spine)."""
    others = []
    for name in skeleton.names:
        swaps = [("Left", "Right"), ("Right", "Left"), ("left", "right"), ("right", "left")]
        swaps += [("l", "r"), ("r", "l"), ("L_", "R_"), ("R_", "L_")]
        names = [to + name[len(frm) :] for frm, to in swaps if name.startswith(frm)]
        names += [name[: -len(frm)] + to for frm, to in [("_l", "_r"), ("_r", "_l")] if name.endswith(frm)]
        found = [other for other in names if other in skeleton.names]
        others.append(skeleton.index(found[0]) if found else skeleton.index(name))
    return np.array(others)


def mirrored(recording: Recording) -> Recording:
    """The dance as a mirror shows it: left and right joints swapped, reflected through the x = 0 plane."""
    pairs = mirror_pairs(recording.skeleton)
    poses = recording.poses[:, pairs] * np.array([1.0, 1.0, -1.0, -1.0])
    return Recording(recording.skeleton, poses, recording.roots * np.array([-1.0, 1.0, 1.0]), recording.fps)


def window_starts(take: Take, hop: int = 1) -> NDArray[np.intp]:
    """First frames of every hop-th of a take's windows in which each pose is sound."""
    if len(take.sound) < WINDOW:
        return np.zeros(0, dtype=np.intp)
    whole = np.lib.stride_tricks.sliding_window_view(take.sound, WINDOW).all(axis=-1)
    return np.flatnonzero(whole)[::hop]


def windows(takes: Sequence[Take], moving: Sequence[int], mirror: bool = False) -> NDArray[np.float32]:
    """Every sound window of the takes, (N, 8, M, 4) float32, and after them their mirror images."""
    found = []
    for take in takes:
        recordings = [take.recording, mirrored(take.recording)] if mirror else [take.recording]
        starts = window_starts(take)
        for recording in recordings:
            poses = recording.poses[:, moving].astype(np.float32)
            found.append(poses[starts[:, None] + np.arange(WINDOW)])
    return np.concatenate(found) if found else np.zeros((0, WINDOW, len(moving), 4), dtype=np.float32)
