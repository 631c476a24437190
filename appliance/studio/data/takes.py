"""Takes: recordings at 50 poses a second in the stage's frame, with their capture errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bvh import leading_tpose_frames, recording_of
from appliance.pose.bvh_text import read_bvh_text
from appliance.pose.reading_options import brought_in
from appliance.pose.recording import Recording
from appliance.studio.data.capture_errors import (
    MARKED,
    CaptureError,
    find_capture_errors,
    sound_frames,
    without,
)
from appliance.studio.data.catalogue import Catalogue
from appliance.studio.data.jumps import Runs, runs

FPS = 50.0
MOVING_DEGREES = 1.0  # joints that turn less than this in every recording are still
TPOSE_FRAMES = 3
Pose = NDArray[np.floating[Any]]


class DatasetError(ValueError):
    """Recordings that cannot be trained on: which, and why."""


@dataclass(frozen=True)
class Take:
    """One recording at 50 Hz with the facts about it."""

    name: str
    take: str
    recording: Recording
    sound: NDArray[np.bool_]  # (N,) frames without a capture error
    header_fps: float
    true_fps: float
    errors: tuple[CaptureError, ...] = ()  # why the others are masked
    notes: tuple[str, ...] = ()  # what had to be done to bring it into the stage's frame
    part_of: str = ""  # the recording of which it is an excerpt
    begins_s: float = 0.0  # there

    @property
    def file(self) -> str:
        """The recording that it is, or is a part of."""
        return self.part_of or self.name

    @property
    def sound_runs(self) -> Runs:
        """First and last + 1 frame of each stretch without a capture error."""
        return runs(self.sound)

    def part(self, first: int, end: int) -> Take:
        """Frames first to end - 1 as a separate take."""
        start_s, end_s = first / FPS, end / FPS
        errors = tuple(
            replace(one, start_s=max(one.start_s, start_s) - start_s, end_s=min(one.end_s, end_s) - start_s)
            for one in self.errors
            if one.start_s < end_s and start_s < one.end_s
        )
        return replace(
            self,
            name=f"{self.name} from {start_s:.1f} s on" if first else self.name,
            recording=self.recording.excerpt(start_s, end_s),
            sound=self.sound[first:end].copy(),
            errors=errors,
            part_of=self.file,
            begins_s=self.begins_s + start_s,
        )


def load_take(file: Path, catalogue: Catalogue, usual: Mapping[str, Pose] | None = None) -> Take:
    """One file at its true rate, T-pose dropped, capture errors marked, resampled to 50 Hz.

    usual: usual orientations (4,) by joint name, which a single file cannot tell.
    """
    take, recorded = read_take(file, catalogue)
    skeleton = recorded.skeleton
    known = {skeleton.index(name): pose for name, pose in (usual or {}).items() if name in skeleton.names}
    return masked_take(take, find_capture_errors([recorded], moving_joints([take]), known)[0], catalogue)


def read_take(file: Path, catalogue: Catalogue) -> tuple[Take, Recording]:
    """A take in which nothing is masked, and its recording at the rate at which it was captured."""
    text = read_bvh_text(file, catalogue.reading.fps_of(file.stem))
    recording = recording_of(text)
    if leading_tpose_frames(recording):
        recording = recording.without_first(TPOSE_FRAMES)
    if not len(recording):
        raise DatasetError(f"{file.name} has no pose but its T-pose. Remove the file.")
    recording, guesses = brought_in(file, recording, catalogue.reading.conventions_of(file.stem))
    resampled = recording.resampled(FPS)
    sound = np.ones(len(resampled), dtype=bool)
    take = catalogue.take_of(file.stem)
    notes = tuple(guess.sentence() for guess in guesses)
    header_fps = text.header_fps or text.fps
    return Take(file.stem, take, resampled, sound, header_fps, text.fps, notes=notes), recording


def masked_take(take: Take, found: Sequence[CaptureError], catalogue: Catalogue) -> Take:
    """The take with its errors masked, except those that the catalogue keeps, and with those that it adds."""
    reported = [CaptureError("", start, end, MARKED) for start, end in catalogue.masked(take.name)]
    errors = (*without(found, catalogue.kept(take.name)), *reported)
    return replace(take, sound=sound_frames(len(take.recording), FPS, errors), errors=errors)


def moving_joints(takes: Sequence[Take]) -> tuple[int, ...]:
    """The root, and the joints that turn more than a degree in any recording."""
    count = len(takes[0].recording.skeleton)
    widest = np.zeros(count)
    for take in takes:
        poses = take.recording.poses
        widest = np.maximum(widest, np.degrees(quaternion.angle_between(poses, poses[:1])).max(axis=0))
    widest[0] = np.inf  # networks turn a window by the heading of their first joint
    return tuple(int(j) for j in np.flatnonzero(widest > MOVING_DEGREES))
