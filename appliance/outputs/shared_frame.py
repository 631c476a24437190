"""The shared frame: each joint frame and once a second the box's health, in memory that others may read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from appliance.outputs.joint_frame import JointFrame
from appliance.pose.skeleton import Skeleton


@dataclass(frozen=True)
class Facts:
    """What does not change while a stage runs: what its readers need to know about the show."""

    show_directory: Path
    box_file: Path | None
    show_name: str
    skeleton: Skeleton
    held: tuple[int, ...]  # joints that hands hold
    hands: tuple[str, ...]  # who holds them
    phrases: tuple[str, ...]
    cues: tuple[dict[str, Any], ...]
    looks: tuple[str, ...]
    lights: tuple[str, ...]  # names of mapping sets
    coding: int
    interaction: int
    most_iterations: int
    pid: int
    started: float  # seconds on the monotonic clock


class FrameWriter:
    """The stage's end: a file `frame` in the runtime folder, a new one for each stage.

    Raises OSError where the folder takes no file of its size.
    """

    def __init__(self, folder: Path, facts: Facts) -> None:
        raise NotImplementedError

    def write(self, frame: JointFrame) -> None:
        """Publish a frame: one copy, no system call, nothing for the collector."""

    def write_health(self, health: Mapping[str, Any]) -> None:
        """Publish how the box is; after the frame has left."""

    def close(self) -> None:
        """The show is over: readers find no stage any more."""
