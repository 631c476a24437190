"""Training data: recordings to windows of poses, split by take, capture errors masked, mirrored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.skeleton import Skeleton
from appliance.studio.data.capture_errors import find_capture_errors
from appliance.studio.data.catalogue import (
    Catalogue,
    find_catalogue,
    left_out_of,
    read_catalogue,
    recordings_in,
)
from appliance.studio.data.mirror import asymmetry, mirrored
from appliance.studio.data.takes import (
    FPS,
    MOVING_DEGREES,
    DatasetError,
    Take,
    load_take,
    masked_take,
    moving_joints,
    read_take,
)

__all__ = [
    "FPS",
    "Catalogue",
    "Dataset",
    "DatasetError",
    "Take",
    "find_catalogue",
    "load_dataset",
    "load_folder",
    "load_take",
    "mean_pose",
    "mirrored",
    "moving_joints",
    "read_catalogue",
    "window_starts",
    "windows",
]

WINDOW = 8
# Fractions of a single take: the end that is held out, the gap before it, and the shortest such take.
END_SHARE, END_LEAST_S, END_GAP_S, ALONE_LEAST_S = 0.15, 3.0, 1.0, 10.0


@dataclass(frozen=True)
class Dataset:
    """Takes with one skeleton; which joints move; which takes are held out."""

    skeleton: Skeleton
    moving: tuple[int, ...]
    training: tuple[Take, ...]
    held_out: tuple[Take, ...]
    catalogue: Catalogue = field(default_factory=Catalogue)  # how they were read
    left_out: str = ""  # what else in their folder looks like recordings

    @property
    def takes(self) -> list[Take]:
        return [*self.training, *self.held_out]

    @property
    def moving_names(self) -> tuple[str, ...]:
        return tuple(self.skeleton.names[j] for j in self.moving)

    @property
    def asymmetry(self) -> str:
        """Why the mirror image is not this dancer's body; '' if it is."""
        return asymmetry(self.skeleton, self.moving, self.still_pose())

    @property
    def mirrors(self) -> bool:
        """Whether mirror images are training data too."""
        return not self.asymmetry

    def measured_on(self, window: int = WINDOW) -> tuple[Take, ...]:
        """The held-out takes; the training takes where no held-out one has a sound window of this length."""
        has_one = any(len(window_starts(take, window=window)) for take in self.held_out)
        return self.held_out if has_one else self.training

    def still_pose(self) -> NDArray[np.float64]:
        """(J, 4): the mean pose of the training takes, in which the still joints stand for good."""
        return mean_pose(self.training)


def load_dataset(
    folder: Path,
    catalogue: Catalogue | None = None,
    progress: Callable[[Sequence[Path]], Sequence[Path]] = lambda files: files,
) -> Dataset:
    """Read every BVH file of a folder. Raises DatasetError if skeletons differ or nothing is left."""
    files = recordings_in(folder)
    if not files:
        raise DatasetError(f"{folder} has no .bvh files. Give the folder that holds your recordings.")
    catalogue = catalogue or find_catalogue(folder, files)
    read = [read_take(file, catalogue) for file in progress(files)]
    takes = [take for take, _ in read]
    skeleton = takes[0].recording.skeleton
    for file, take in zip(files, takes, strict=True):
        if not take.recording.skeleton.same_joints(skeleton):
            raise DatasetError(
                f"{file.name} has another skeleton than {files[0].name}. Train one dancer on one skeleton: "
                "move the file to another folder."
            )
    moving = moving_joints(takes)
    if len(moving) < 2:
        raise DatasetError(
            f"Nothing moves in the recordings of {folder}: no joint turns by more than {MOVING_DEGREES:g} "
            "degree. Export them again with their rotations."
        )
    commas = [name for name in (skeleton.names[joint] for joint in moving) if "," in name]
    if commas:
        raise DatasetError(
            f"'{commas[0]}' in {files[0].name} has a comma in its name, which parts the joints' names in a "
            "network's file. Rename the joint in all recordings."
        )
    errors = find_capture_errors([recorded for _, recorded in read], moving)
    takes = [masked_take(take, found, catalogue) for take, found in zip(takes, errors, strict=True)]
    training, held_out = _kept_apart(takes, catalogue)
    if not any(take.sound.any() for take in training):
        raise DatasetError(
            "Every frame is masked as a capture error: nothing is left to train on. "
            "Name sound files with --keep."
        )
    return Dataset(skeleton, moving, training, held_out, catalogue, left_out_of(folder))


def load_folder(folder: Path, reading: ReadingOptions) -> Dataset:
    """As load_dataset; what reading says comes before a catalogue that lists the files."""
    return load_dataset(folder, find_catalogue(folder, recordings_in(folder)).with_options(reading))


def _kept_apart(takes: Sequence[Take], catalogue: Catalogue) -> tuple[tuple[Take, ...], tuple[Take, ...]]:
    """Training and held-out takes: whole takes, or the end of a single take.

    Where none is named, those that the network did not learn from, of a new one the last: takes may have come
    or gone since, and no measured one may be a learned one.
    """
    held = {take.take for take in takes if catalogue.is_held_out(take.name)}
    names = sorted({take.take for take in takes})
    if not held and len(names) == 1:
        return _ends_kept_apart(takes)
    learned = set(names) & set(catalogue.learned)
    held = held or (set(names) - learned if learned else {names[-1]})
    if held.issuperset(names):
        raise DatasetError("Every take is held out: nothing is left to train on.")
    training = tuple(take for take in takes if take.take not in held)
    return training, tuple(take for take in takes if take.take in held)


def _ends_kept_apart(takes: Sequence[Take]) -> tuple[tuple[Take, ...], tuple[Take, ...]]:
    """The same last part of each recording of the only take; nothing of a short one."""
    count = min(len(take.recording) for take in takes)
    end = count - round(max(END_SHARE * count, END_LEAST_S * FPS))
    if count < ALONE_LEAST_S * FPS:
        return tuple(takes), ()
    training = tuple(take.part(0, end - round(END_GAP_S * FPS)) for take in takes)
    return training, tuple(take.part(end, len(take.recording)) for take in takes)


def mean_pose(takes: Sequence[Take]) -> NDArray[np.float64]:
    """(J, 4): mean of the sound poses, their heading removed."""
    poses = np.concatenate([take.recording.poses[take.sound] for take in takes])
    facing = quaternion.heading(poses[:, :1])
    poses = np.concatenate([quaternion.multiply(quaternion.inverse(facing), poses[:, :1]), poses[:, 1:]], 1)
    mean = quaternion.aligned(poses, poses[len(poses) // 2]).mean(axis=0)
    return quaternion.normalize(mean).astype(np.float64)


def window_starts(take: Take, hop: int = 1, window: int = WINDOW) -> NDArray[np.intp]:
    """First frames of every hop-th of a take's windows in which each pose is sound."""
    if len(take.sound) < window:
        return np.zeros(0, dtype=np.intp)
    whole = np.lib.stride_tricks.sliding_window_view(take.sound, window).all(axis=-1)
    return np.flatnonzero(whole)[::hop]


def windows(
    takes: Sequence[Take], moving: Sequence[int], mirror: bool = False, window: int = WINDOW, hop: int = 1
) -> NDArray[np.float32]:
    """Every hop-th sound window of the takes, (N, window, M, 4) float32, then their mirror images."""
    found = []
    for take in takes:
        recordings = [take.recording, mirrored(take.recording)] if mirror else [take.recording]
        starts = window_starts(take, hop, window)
        for recording in recordings:
            poses = recording.poses[:, moving].astype(np.float32)
            found.append(poses[starts[:, None] + np.arange(window)])
    return np.concatenate(found) if found else np.zeros((0, window, len(moving), 4), dtype=np.float32)
