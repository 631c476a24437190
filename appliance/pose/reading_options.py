"""How to read other people's recordings: facts that are not in the files."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from appliance.pose.bvh import BvhError, read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import UnknownJointError
from appliance.pose.stage_frame import CENTIMETRE, FileConventions, Guess, in_stage_frame


@dataclass(frozen=True)
class ReadingOptions:
    """Facts about recordings beyond their files, by pattern of their names; the first that fits counts.

    metres_per_unit; up: 'y' or 'z'; facing: a key of FACINGS; root: a joint's name; all_frames: none is a
    capture error.
    """

    metres_per_unit: Mapping[str, float] = field(default_factory=dict)
    up: Mapping[str, str] = field(default_factory=dict)
    facing: Mapping[str, str] = field(default_factory=dict)
    true_fps: Mapping[str, float] = field(default_factory=dict)
    root: Mapping[str, str] = field(default_factory=dict)
    all_frames: bool = False

    def conventions_of(self, name: str) -> FileConventions:
        """Conventions for a recording of this name (without its ending)."""
        found = (first_fit(one, name) for one in (self.metres_per_unit, self.up, self.facing, self.root))
        return FileConventions(*found)

    def fps_of(self, name: str) -> float | None:
        """Its rate, where its header is wrong."""
        rate: float | None = first_fit(self.true_fps, name)
        return rate

    def over(self, other: ReadingOptions) -> ReadingOptions:
        """These, and the other's where these say nothing."""
        mapped = ("metres_per_unit", "up", "facing", "true_fps", "root")
        joined = {name: {**getattr(self, name), **_rest(getattr(other, name), self, name)} for name in mapped}
        return ReadingOptions(**joined, all_frames=self.all_frames or other.all_frames)


AS_THE_FILES_SAY = ReadingOptions()


def _rest(known: Mapping[str, Any], first: ReadingOptions, name: str) -> dict[str, Any]:
    """The facts of the patterns below the first ones."""
    return {pattern: value for pattern, value in known.items() if pattern not in getattr(first, name)}


def first_fit(by_pattern: Mapping[str, Any], name: str) -> Any:
    """The value of the first pattern that fits a name; None without one."""
    return next((value for pattern, value in by_pattern.items() if fnmatch.fnmatch(name, pattern)), None)


def read_upright(path: Path, options: ReadingOptions = AS_THE_FILES_SAY) -> tuple[Recording, list[Guess]]:
    """A BVH file in the stage's frame, and what was lost or changed.

    Raises BvhError, also for a root that it does not have, or OSError.
    """
    recording = read_bvh(path, true_fps=options.fps_of(path.stem))
    return brought_in(path, recording, options.conventions_of(path.stem))


def brought_in(
    path: Path, recording: Recording, conventions: FileConventions, unit_m: float = CENTIMETRE
) -> tuple[Recording, list[Guess]]:
    """A recording of this file in the stage's frame, and what was lost or changed.

    unit_m: of the file's lengths, as it was read. Raises BvhError for a root that it does not have.
    """
    try:
        found, guesses = in_stage_frame(recording, conventions, unit_m=unit_m)
    except UnknownJointError as error:
        raise BvhError(path, 1, f"{error} Give another --root.") from error
    return found, [*(Guess(note, "") for note in recording.notes), *guesses]
